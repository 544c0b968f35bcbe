"""The page of a session of this process: `trocar view` in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager

from hub.command_line.display import console
from hub.hosting.end_with_parent import NEEDS_INPUT

__all__ = ["page_of_this_process"]

_PATIENCE_S = 3.0
_NOTICE_S = 2.0
"""Time in which a server without a page ends, on a machine that is not busy."""


@contextmanager
def page_of_this_process() -> Generator[None]:
    """Serve the page of this process' session; at the end of the context, until the last page has gone.

    The page goes with an error, and with Ctrl-C.
    """
    command = [
        sys.executable,
        "-P",
        "-m",
        "trocar",
        "view",
        "--one-session",
        "--with-parent",
        str(os.getpid()),
    ]
    server = subprocess.Popen(command, stdin=subprocess.PIPE if NEEDS_INPUT else subprocess.DEVNULL)
    try:
        yield
        _wait_for_last_page(server)
    finally:
        server.terminate()
        try:
            server.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()


def _wait_for_last_page(server: subprocess.Popen[bytes]) -> None:
    try:
        try:
            server.wait(_NOTICE_S)
        except subprocess.TimeoutExpired:
            console.print("the page stays until it has been closed for a minute; Ctrl-C ends it now")
            server.wait()
    except KeyboardInterrupt:
        return
