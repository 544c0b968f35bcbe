"""Accepts connections of other ROS 1 programs."""

from __future__ import annotations

import logging
import socket
import sys
import threading
from collections.abc import Callable
from functools import partial

from devices.ros.ros1.event_loop import EventLoop

__all__ = ["Listener"]

log = logging.getLogger(__name__)

_BACKLOG = 512
"""Most connections at once: a console with subscriptions to all topics makes several hundred."""
_PAUSE_S = 1.0
_FILES = 16384


class Listener:
    """A listening socket at a free port."""

    def __init__(self, loop: EventLoop, host: str, on_connection: Callable[[socket.socket], None]) -> None:
        """Listen at the address `host`; `on_connection` gets the socket of each connection."""
        _raise_file_limit()
        self._loop, self._on_connection = loop, on_connection
        self._socket = socket.create_server((host, 0), backlog=_BACKLOG)
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        self._watch()

    def _watch(self) -> None:
        self._loop.call(partial(self._loop.watch, self._socket, self))

    def readable(self) -> None:
        """Accept a connection."""
        try:
            sock, _ = self._socket.accept()
        except BlockingIOError:
            return
        except OSError as error:  # too many open files: the socket stays readable
            log.warning("ROS 1: a program cannot connect: %s", error)
            self._loop.forget(self._socket)
            pause = threading.Timer(_PAUSE_S, self._watch)
            pause.daemon = True
            pause.start()
            return
        try:
            self._on_connection(sock)
        except OSError:  # closed by the other side already
            sock.close()

    def writable(self) -> None:
        """A listening socket is never written to."""

    def close(self) -> None:
        """Stop listening; in the loop's thread."""
        self._loop.forget(self._socket)
        self._socket.close()


def _raise_file_limit() -> None:
    """Raise this process's limit of open files: in ROS 1 each topic of each program is a socket."""
    if sys.platform != "win32":
        import resource

        allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = _FILES if most == resource.RLIM_INFINITY else min(most, _FILES)
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(allowed, wanted), most))
