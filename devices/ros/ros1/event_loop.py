"""A thread waiting for all sockets of a ROS 1 node: to read, to write, to accept connections."""

from __future__ import annotations

import logging
import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

__all__ = ["EventLoop", "SocketHandler"]

log = logging.getLogger(__name__)


class SocketHandler(Protocol):
    """The owner of a socket."""

    def readable(self) -> None:
        """Read arrived bytes, without blocking."""
        ...

    def writable(self) -> None:
        """Write queued bytes, without blocking. Called only after `EventLoop.watch(..., writing=True)`."""
        ...

    def close(self) -> None:
        """Close the socket. May be called twice."""
        ...


class EventLoop:
    """Calls the owners of sockets in a single thread; other threads schedule calls there."""

    def __init__(self, name: str) -> None:
        """Start the thread `name`."""
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
        """Schedule `do` in the loop's thread; from any thread."""
        self._calls.append(do)
        with suppress(OSError):  # full of such bytes, or closed
            self._wake.send(b"\0")

    def watch(self, sock: socket.socket, handler: SocketHandler, *, writing: bool = False) -> None:
        """Call `handler` when `sock` can be read or, if `writing`, written; in the loop's thread only."""
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if writing else 0)
        if sock in self._selector.get_map():
            self._selector.modify(sock, events, handler)
        else:
            self._selector.register(sock, events, handler)

    def forget(self, sock: socket.socket) -> None:
        """Stop watching a socket, before closing the socket; in the loop's thread only."""
        if sock in self._selector.get_map():
            self._selector.unregister(sock)

    def _run(self) -> None:
        while not self._ending:
            for key, events in self._selector.select():
                if key.fileobj is self._woken:
                    self._drain_calls()
                else:
                    self._serve(key.data, events)
            while self._calls:
                self._guard_call(self._calls.popleft())

    def _drain_calls(self) -> None:
        with suppress(BlockingIOError):
            self._woken.recv(4096)

    def _serve(self, handler: SocketHandler, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            self._guard_call(handler.writable)
        if events & selectors.EVENT_READ:
            self._guard_call(handler.readable)

    def _guard_call(self, do: Callable[[], None]) -> None:
        """Call `do`; an unforeseen error with a program must not end the loop for all others."""
        try:
            do()
        except Exception:
            log.exception("a connection of ROS 1 has failed")

    def _end(self) -> None:
        for key in tuple(self._selector.get_map().values()):
            if key.fileobj is not self._woken:
                self._guard_call(key.data.close)
        self._ending = True

    def close(self) -> None:
        """Close all watched sockets, and end the thread."""
        self.call(self._end)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
        self._selector.close()
        self._wake.close()
        self._woken.close()
