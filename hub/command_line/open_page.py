"""The page of a session of this process: `trocar view` in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager

from hub.hosting.end_with_parent import NEEDS_INPUT

__all__ = ["page_of_this_process"]

_PATIENCE_S = 3.0


@contextmanager
def page_of_this_process() -> Generator[None]:
    """Serve the page of this process' session while the context lasts."""
    command = [sys.executable, "-P", "-m", "trocar", "view", "--with-parent", str(os.getpid())]
    server = subprocess.Popen(command, stdin=subprocess.PIPE if NEEDS_INPUT else subprocess.DEVNULL)
    try:
        yield
    finally:
        server.terminate()
        try:
            server.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()
