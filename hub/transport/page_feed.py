"""The feed of an output for pages: of a signal some values a second of wall time, of events each message.

A page is no reader of the simulation: nothing waits for a page, a message that cannot be sent is dropped, and
no value is encoded that a page would not show. While no page looks, an output costs nothing more. Events are
not repeated, so pictures, which fill a link, have a lower priority and so a queue of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns
from typing import Any

import zenoh

from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.port_codec import PortCodec
from hub.transport.publisher import Publisher

__all__ = ["PageFeed"]

PERIOD_NS = 16_000_000
"""Least wall time between two values of a signal, for a display of 60 Hz."""
_FIRST_NS = 1_000_000_000
"""Wall time until the state at time 0 is repeated: pages come late, and messages may be dropped."""


class PageFeed:
    """Publishes an output for pages, while any subscribes.

    Args:
        session: The Zenoh session.
        key: The key of the output for pages.
        codec: The codec of the port.
        run: The number of the run.
        changed: Is called whenever `needed` may have changed.
    """

    def __init__(
        self, session: zenoh.Session, key: str, codec: PortCodec, run: int, changed: Callable[[], None]
    ) -> None:
        self._codec, self._run, self._changed = codec, run, changed
        self._first: tuple[bytes, bytes] | None = None
        """State at time 0 of a message, which may hold data that later ones lack: the surface of an organ."""
        self._due_ns = self._first_due_ns = 0
        self._publisher = Publisher(
            session,
            key,
            zenoh.CongestionControl.DROP,
            self._matched,
            always=False,
            priority=zenoh.Priority.INTERACTIVE_HIGH if codec.is_event else zenoh.Priority.DATA,
        )

    @property
    def needed(self) -> bool:
        """Whether a page subscribes."""
        return self._publisher.needed

    def _matched(self) -> None:
        self._first_due_ns = 0
        self._changed()

    def keep_first(self, time_ns: int, value: Any) -> None:
        """Keep the value at time 0 of a signal without a vector form, for later pages."""
        if self._codec.vector is None and not self._codec.is_event:
            self._first = self._codec.encode(value, time_ns), Tag.pack(self._run, 0, INITIAL, time_ns)

    def put(self, step: int, time_ns: int, value: Any) -> None:
        """Publish the value computed in `step`, valid at `time_ns`; of a signal only when due."""
        if self._codec.is_event:
            for message in value:
                self._publisher.put(
                    self._codec.encode(message, time_ns), Tag.pack(self._run, 0, step, time_ns)
                )
            return
        now_ns = monotonic_ns()
        if now_ns < self._due_ns and step != INITIAL:
            return
        self._due_ns = now_ns + PERIOD_NS
        if self._first is not None and now_ns >= self._first_due_ns:
            self._first_due_ns = now_ns + _FIRST_NS
            self._publisher.put(*self._first)
        self._publisher.put(self._codec.encode(value, time_ns), Tag.pack(self._run, 0, step, time_ns))

    def close(self) -> None:
        """Publish no more."""
        self._publisher.close()
