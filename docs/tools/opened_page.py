"""The page of a command of trocar, opened in Debian's chromium without a GPU."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

from playwright.sync_api import Page, ViewportSize, sync_playwright

__all__ = ["TROCAR", "opened", "wait"]

TROCAR = (sys.executable, "-P", "-m", "trocar")
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SLOWEST_MS = 600_000


@contextmanager
def opened(*command: str, size: ViewportSize, script: str = "") -> Generator[Page]:
    """Run a command of trocar, and yield its page; the command is interrupted at the end.

    Args:
        command: words, such as `view` and a directory.
        size: of the page, pixels.
        script: runs in the page before its own.
    """
    with tempfile.TemporaryFile("w+") as said:
        run = subprocess.Popen(
            [*TROCAR, *command], stdout=said, stderr=said, env=os.environ | {"BROWSER": "true"}
        )
        try:
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
                page = browser.new_page(viewport=size)
                page.set_default_timeout(SLOWEST_MS)
                page.add_init_script(script)
                page.goto(_address(run, Path(f"/proc/self/fd/{said.fileno()}")))
                yield page
                browser.close()
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()


def _address(run: subprocess.Popen[bytes], said: Path) -> str:
    while not (link := re.search(r"http://127\S+(?=\s)", text := said.read_text())):
        if run.poll() is not None:
            raise SystemExit(text)
        sleep(0.1)
    return link[0]


def wait(page: Page, expression: str) -> None:
    """Wait until an expression of the page is true; what waits within the page is against its policy."""
    while not page.evaluate(expression):
        sleep(0.05)
