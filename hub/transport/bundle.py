"""Bundles: the signals of one participant for a wall-time device or an observer, all of a step in a message.

A gateway to ROS receives a hundred of them at a time. As a message each they took the hub 1.9 ms of a step
(docs/decisions/0034).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator

import zenoh

from hub.planning.plan import ConnectionToDevice, Plan
from hub.transport.publisher import Publisher
from schemas.errors import MessageError

__all__ = ["Bundle", "ObserverBundle", "bundled", "unpacked"]

_HEAD = struct.Struct("<II")
"""Index of the connection, and the number of bytes of CDR that follow."""


def bundled(plan: Plan, source: str, target: str) -> list[ConnectionToDevice]:
    """Return the connections in a bundle, those of signals, in the order of their indices."""
    return [
        outlet
        for outlet in plan.to_devices
        if (outlet.source, outlet.target) == (source, target)
        and plan.participants[source].port(outlet.source_port).variability == "signal"
    ]


class Bundle:
    """Collects the values of a step for a device and publishes them under `key`.

    A reader whose connection is congested misses some, and delays no one. `changed` is called whenever
    `needed` may have changed.
    """

    def __init__(self, session: zenoh.Session, key: str, changed: Callable[[], None]) -> None:
        self._parts: list[bytes] = []
        self._changed = changed
        self._publisher = Publisher(session, key, zenoh.CongestionControl.DROP, self._matched, always=False)

    @property
    def needed(self) -> bool:
        """Whether the reader subscribes."""
        return self._publisher.needed

    def takes(self, time_ns: int, stride_ns: int) -> bool:  # noqa: ARG002
        """Return whether to add the value of `time_ns`, which holds for `stride_ns`."""
        return self.needed

    def _matched(self) -> None:
        self._changed()

    @property
    def filled(self) -> bool:
        """Whether there is anything to send."""
        return bool(self._parts)

    def add(self, index: int, payload: bytes) -> None:
        """Add the value of the connection with this index."""
        self._parts += _HEAD.pack(index, len(payload)), payload

    def send(self, tag: bytes, *, first: bool = False) -> None:  # noqa: ARG002
        """Publish what was added since the last time; `first`: the values at time 0."""
        self._publisher.put(b"".join(self._parts), tag)
        self._parts.clear()

    def close(self) -> None:
        """Publish no more."""
        self._publisher.close()


class ObserverBundle(Bundle):
    """A bundle of the values that an observer would read at its own period, and of no others.

    The values at time 0 may bring what later ones lack, such as the surface of a soft body: they are sent
    again before all others to an observer that joins again.
    """

    def __init__(self, session: zenoh.Session, key: str, changed: Callable[[], None], period_ns: int) -> None:
        self._period_ns = period_ns
        self._first: tuple[bytes, bytes] | None = None
        self._joins = False
        super().__init__(session, key, changed)

    def _matched(self) -> None:
        self._joins = True
        super()._matched()

    def takes(self, time_ns: int, stride_ns: int) -> bool:
        """Return whether to add the value of `time_ns`: it holds at a multiple of the period."""
        return self.needed and -time_ns % self._period_ns < stride_ns

    def send(self, tag: bytes, *, first: bool = False) -> None:
        """Publish what was added since the last time; `first`: the values at time 0."""
        if first:
            self._first = b"".join(self._parts), tag
        elif self._joins and self._first is not None:
            self._publisher.put(*self._first)
        self._joins = False
        super().send(tag)


def unpacked(payload: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield index and CDR of each value in a bundle; raises MessageError if the bytes are invalid."""
    at = 0
    while at < len(payload):
        if len(payload) - at < _HEAD.size:
            raise MessageError(f"a bundle of {len(payload)} bytes ends within a head")
        index, size = _HEAD.unpack_from(payload, at)
        at += _HEAD.size + size
        if at > len(payload):
            raise MessageError(f"a bundle of {len(payload)} bytes ends within a value of {size}")
        yield index, payload[at - size : at]
