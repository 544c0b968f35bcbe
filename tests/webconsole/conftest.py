"""A small recorded session, its server in this process, and a browser if there is one."""

import asyncio
import http.client
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager

import pytest

pytest.importorskip("starlette", reason="needs trocar[web]")

from tests.hub.sample_session import write_session
from webconsole.console import Console
from webconsole.library import Library
from webconsole.listening import on_loopback
from webconsole.pilot import Pilots
from webconsole.recorded import Recorded
from webconsole.server import Server

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@contextmanager
def served(source, pilots=None, listening=None, home=None):
    """Serve pages of a source, and of the recordings in `home`, in a thread; yield the server."""
    with ExitStack() as stack:
        console = Console(source, pilots or Pilots())
        library = None if home is None else Library(home, console, stack)
        server = Server(console, listening or on_loopback(0), library=library)
        thread = threading.Thread(target=server.run)
        thread.start()
        try:
            yield server
        finally:
            server.stop()
            thread.join()


def finish(coroutine):
    """Run a coroutine to its end; in a thread, as the browser's driver keeps a loop in that of the tests."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, coroutine).result()


def cookie_of(host, path):
    """Return the cookie of a browser that opens a link."""
    connection = http.client.HTTPConnection(host)
    connection.request("GET", path)
    cookie = connection.getresponse().headers["Set-Cookie"].partition(";")[0]
    connection.close()
    return cookie


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium that draws with its own software; the tests skip where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (trocar[test])")
    if CHROMIUM is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=flags)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    """A recorded session without scenes: it is made of formulas."""
    directory = tmp_path_factory.mktemp("webconsole") / "palpation"
    write_session(directory, seconds=0.5)
    return directory


@pytest.fixture(scope="module")
def console_of_recording(recording):
    """Its pages; a server of its own for each module."""
    with served(Recorded(recording)) as server:
        yield server
