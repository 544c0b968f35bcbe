"""One thread that waits for all sockets of a ROS 1 node: for bytes to read, for room to write, for programs
that connect.
"""

from __future__ import annotations

import logging
import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

__all__ = ["Ears", "Loop"]

log = logging.getLogger(__name__)


class Ears(Protocol):
    """What owns a socket."""

    def readable(self) -> None:
        """Read what there is, without waiting."""
        ...

    def writable(self) -> None:
        """Write what has waited for room, without waiting. Called only after `Loop.watch(..., writing=True)`."""
        ...

    def close(self) -> None:
        """Close the socket. May be called twice."""
        ...


class Loop:
    """Calls the owners of sockets in one thread. Other threads hand it what is to be done there."""

    def __init__(self, name: str) -> None:
        """Take the thread's name, and begin."""
        self._selector = selectors.DefaultSelector()
        self._calls: deque[Callable[[], None]] = deque()
        self._wake, self._woken = socket.socketpair()
        for end in (self._wake, self._woken):
            end.setblocking(False)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._ending = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def call(self, do: Callable[[], None]) -> None:
        """Have `do` called in the loop's thread, soon; from any thread."""
        self._calls.append(do)
        with suppress(OSError):  # it is full of such bytes, or closed
            self._wake.send(b"\0")

    def watch(self, sock: socket.socket, ears: Ears, *, writing: bool = False) -> None:
        """Call `ears` when there is something to read on `sock` and, if `writing`, room to write; in the
        loop's thread only.
        """
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if writing else 0)
        if sock in self._selector.get_map():
            self._selector.modify(sock, events, ears)
        else:
            self._selector.register(sock, events, ears)

    def forget(self, sock: socket.socket) -> None:
        """Watch a socket no more, before it is closed; in the loop's thread only."""
        if sock in self._selector.get_map():
            self._selector.unregister(sock)

    def _run(self) -> None:
        while not self._ending:
            for key, events in self._selector.select():
                if key.fileobj is self._woken:
                    self._drain()
                else:
                    self._serve(key.data, events)
            while self._calls:
                self._guarded(self._calls.popleft())

    def _drain(self) -> None:
        with suppress(BlockingIOError):
            self._woken.recv(4096)

    def _serve(self, ears: Ears, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            self._guarded(ears.writable)
        if events & selectors.EVENT_READ:
            self._guarded(ears.readable)

    def _guarded(self, do: Callable[[], None]) -> None:
        """Call what must not end the loop: one program that goes wrong in a way nobody thought of is not to
        cut off the others.
        """
        try:
            do()
        except Exception:
            log.exception("a connection of ROS 1 has failed")

    def _end(self) -> None:
        for key in tuple(self._selector.get_map().values()):
            if key.fileobj is not self._woken:
                self._guarded(key.data.close)
        self._ending = True

    def close(self) -> None:
        """Close all sockets that are watched, and end the thread."""
        self.call(self._end)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
        self._selector.close()
        self._wake.close()
        self._woken.close()
