"""What the simulation tells, on its way to ROS: the newest value of each state, and events at once."""

from __future__ import annotations

import threading
from time import monotonic_ns

from devices.ros.row import Row
from devices.ros.stamps import Stamps, stamped
from devices.ros.traffic import Count
from devices.ros.transport import Publisher
from hub.participant import Value
from schemas.codec import encode
from schemas.message import Message
from schemas.vectors import Vector, VectorCodec

__all__ = ["Event", "State"]

_SILENT_NS = 1_000_000_000
"""A state that is older is not published any more: a program is to see that nothing comes, as a CRTK client does after this time (its connection_timeout)."""


class State:
    """A row that is published all the time. Written by one thread, published by another."""

    def __init__(self, row: Row, publish: Publisher, count: Count) -> None:
        """Take the row, where it goes, and what counts its messages."""
        assert row.port is not None
        self._codec = VectorCodec(row.port)
        self._publish, self._count, self._stamps = publish, count, Stamps()
        self._newest: tuple[Vector, int] | None = None

    def write(self, value: Vector) -> None:
        """Take the newest value."""
        self._newest = value, monotonic_ns()

    @property
    def value(self) -> Vector | None:
        """The newest value; None if none came within a second."""
        newest = self._newest
        return newest[0] if newest is not None and monotonic_ns() - newest[1] < _SILENT_NS else None

    def publish(self) -> None:
        """Publish the newest value, if there is one."""
        value = self.value
        if value is not None:
            self._publish(self._codec.encode(value, self._stamps.next_ns()))
            self._count.messages += 1


class Event:
    """A row of which every message is published at once, by whatever thread brings it."""

    def __init__(self, publish: Publisher, count: Count) -> None:
        """Take where it goes, and what counts its messages."""
        self._publish, self._count, self._stamps = publish, count, Stamps()
        self._publishing = threading.Lock()

    def write(self, value: Value) -> None:
        """Publish a message, or several in their order, stamped now."""
        for message in value if isinstance(value, tuple) else (value,):
            if isinstance(message, Message):
                with self._publishing:
                    self._publish(encode(stamped(message, self._stamps.next_ns())))
                    self._count.messages += 1
