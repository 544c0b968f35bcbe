"""Where other programs of ROS 1 connect to ours."""

from __future__ import annotations

import logging
import socket
import sys
import threading
from collections.abc import Callable
from functools import partial

from devices.ros.ros1.loop import Loop

__all__ = ["Listener"]

log = logging.getLogger(__name__)

_BACKLOG = 512
"""Connections that may come at once: a console that wants all topics makes several hundred."""
_PAUSE_S = 1.0
_FILES = 16384


class Listener:
    """A socket at a free port."""

    def __init__(self, loop: Loop, host: str, came: Callable[[socket.socket], None]) -> None:
        """Take the address to listen at, and what takes each connection."""
        _allow_many()
        self._loop, self._came = loop, came
        self._socket = socket.create_server((host, 0), backlog=_BACKLOG)
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        self._watch()

    def _watch(self) -> None:
        self._loop.call(partial(self._loop.watch, self._socket, self))

    def readable(self) -> None:
        """Take a connection."""
        try:
            sock, _ = self._socket.accept()
        except BlockingIOError:
            return
        except OSError as error:  # too many open files: what waits stays readable
            log.warning("ROS 1: a program cannot connect: %s", error)
            self._loop.forget(self._socket)
            pause = threading.Timer(_PAUSE_S, self._watch)
            pause.daemon = True
            pause.start()
            return
        try:
            self._came(sock)
        except OSError:  # gone already
            sock.close()

    def writable(self) -> None:
        """Nothing is written here."""

    def close(self) -> None:
        """Listen no more; in the loop's thread."""
        self._loop.forget(self._socket)
        self._socket.close()


def _allow_many() -> None:
    """Let this process open as many files as the system grants it, within reason: in ROS 1 each topic of each
    program is one.
    """
    if sys.platform != "win32":
        import resource

        allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = _FILES if most == resource.RLIM_INFINITY else min(most, _FILES)
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(allowed, wanted), most))
