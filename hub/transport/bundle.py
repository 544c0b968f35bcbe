"""What the signals of one participant are for one device of the wall clock, all of a step in one message.

A gateway to ROS is told a hundred of them at a time. As a message each they took the hub 1.9 ms of a step
(docs/decisions/0034).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

import zenoh

from hub.planning.plan import ConnectionToDevice, Plan
from hub.transport.publisher import Publisher
from schemas.errors import MessageError

__all__ = ["Bundle", "bundled", "unpacked"]

_HEAD = struct.Struct("<II")
"""Which of the outlets, and how many bytes of CDR follow."""


def bundled(plan: Plan, source: str, device: str) -> list[ConnectionToDevice]:
    """Return the connections whose values go together, in the order in which both ends count them: those of
    signals.
    """
    between = (outlet for outlet in plan.to_devices if (outlet.source, outlet.target) == (source, device))
    return [
        outlet
        for outlet in between
        if plan.participants[source].port(outlet.source_port).variability == "signal"
    ]


class Bundle:
    """Collects and publishes. A device to which the way is choked misses some, and holds nobody up."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        """Take the key on which the device listens."""
        self._parts: list[bytes] = []
        self._way = Publisher(session, key, zenoh.CongestionControl.DROP, lambda: None, always=False)

    @property
    def wanted(self) -> bool:
        """Whether the device listens."""
        return self._way.wanted

    def add(self, index: int, payload: bytes) -> None:
        """Put the value of an outlet to those that go with this step."""
        self._parts += _HEAD.pack(index, len(payload)), payload

    def send(self, tag: bytes) -> None:
        """Publish what has been collected, if there is anything."""
        if self._parts:
            self._way.put(b"".join(self._parts), tag)
            self._parts.clear()

    def close(self) -> None:
        """Publish no more."""
        self._way.close()


def unpacked(payload: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield outlet and CDR of each value in a bundle. Raises MessageError if the bytes are none."""
    at = 0
    while at < len(payload):
        if len(payload) - at < _HEAD.size:
            raise MessageError(f"a bundle of {len(payload)} bytes ends within a head")
        index, size = _HEAD.unpack_from(payload, at)
        at += _HEAD.size + size
        if at > len(payload):
            raise MessageError(f"a bundle of {len(payload)} bytes ends within a value of {size}")
        yield index, payload[at - size : at]
