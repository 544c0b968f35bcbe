"""Bundles: the signals of one participant for one wall-time device, all of a step in one message.

A gateway to ROS receives a hundred of them at a time. As a message each they took the hub 1.9 ms of a step
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
"""Index of the connection, and the number of bytes of CDR that follow."""


def bundled(plan: Plan, source: str, device: str) -> list[ConnectionToDevice]:
    """Return the connections in a bundle, those of signals, in the order of their indices."""
    return [
        outlet
        for outlet in plan.to_devices
        if (outlet.source, outlet.target) == (source, device)
        and plan.participants[source].port(outlet.source_port).variability == "signal"
    ]


class Bundle:
    """Collects the values of a step and publishes them under `key`.

    A device whose connection is congested misses some, and delays no one.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._parts: list[bytes] = []
        self._publisher = Publisher(session, key, zenoh.CongestionControl.DROP, lambda: None, always=False)

    @property
    def needed(self) -> bool:
        """Whether the device subscribes."""
        return self._publisher.needed

    def add(self, index: int, payload: bytes) -> None:
        """Add the value of the connection with this index."""
        self._parts += _HEAD.pack(index, len(payload)), payload

    def send(self, tag: bytes) -> None:
        """Publish what was added since the last time, if anything."""
        if self._parts:
            self._publisher.put(b"".join(self._parts), tag)
            self._parts.clear()

    def close(self) -> None:
        """Publish no more."""
        self._publisher.close()


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
