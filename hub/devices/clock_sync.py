"""Measures the offset to the hub's clock, again and again."""

from __future__ import annotations

import threading
from time import monotonic_ns
from types import TracebackType
from typing import Self

import zenoh

from hub.devices.clock_offset import ClockExchange, ClockOffset
from hub.transport.control_client import ask
from hub.transport.control_messages import ClockReply, Empty
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys

__all__ = ["ClockSync"]

_FIRST, _FIRST_PERIOD_S = 8, 0.05
_PERIOD_S = 0.5


class ClockSync:
    """Queries the hub's clock in its `with` block: a few times in quick succession, then twice a second."""

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self.offset = ClockOffset()
        self._session, self._key = session, keys.control("clock")
        self._ending, self._ended = threading.Event(), threading.Event()
        """Not a join: interrupted, it takes a running thread for ended (CPython 3.11)."""
        self._thread = threading.Thread(target=self._run, name="clock", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.set()
        try:
            self._ended.wait()
        finally:  # interrupted by Ctrl-C; the session is closed next, and Zenoh allows no query beside that
            self._ended.wait()

    def _run(self) -> None:
        try:
            self._ask_repeatedly()
        finally:
            self._ended.set()

    def _ask_repeatedly(self) -> None:
        asked = 0
        while not self._ending.wait(_FIRST_PERIOD_S if asked < _FIRST else _PERIOD_S):
            asked += 1
            asked_ns = monotonic_ns()
            try:
                reply = ask(self._session, self._key, Empty(), ClockReply, timeout_s=1.0)
            except (ConnectError, MessageError, zenoh.ZError):
                continue  # the hub is gone, or about to go: its token tells the host
            self.offset.add(ClockExchange(asked_ns, reply.received_ns, reply.replied_ns, monotonic_ns()))
