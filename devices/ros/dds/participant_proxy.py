"""Record of a program on the domain, kept by the RTPS participant of services and subscriptions."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field

from devices.ros.dds.endpoints import Service
from devices.ros.dds.rtps import Data, FromWriter
from devices.ros.dds.stateful import StatefulReader, StatefulWriter
from schemas.errors import MessageError

__all__ = ["ParticipantProxy", "require_room"]

_MOST_EARLY = 64
_MOST_ENDPOINTS = 1024
"""Most endpoints of each kind: memory is limited, whatever is sent on the domain."""


@dataclass(slots=True)
class ParticipantProxy:
    """A remote participant, and our matched endpoints."""

    metatraffic: tuple[str, int]
    """Address for SPDP and SEDP."""
    default: tuple[str, int]
    """Address for all other messages."""
    announced_s: float
    """Time of the last announcement, by the monotonic clock."""
    readers: dict[bytes, StatefulReader] = field(default_factory=dict[bytes, StatefulReader])
    """Readers by EntityId of the remote writer."""
    writers: dict[tuple[bytes, bytes], StatefulWriter] = field(
        default_factory=dict[tuple[bytes, bytes], StatefulWriter]
    )
    """Writers by EntityIds of our writer and the remote reader."""
    publications: dict[bytes, bytes] = field(default_factory=dict[bytes, bytes])
    """Topics, in the form of parameters, by EntityId of the remote writer."""
    gone: deque[bytes] = field(default_factory=lambda: deque[bytes](maxlen=_MOST_ENDPOINTS))
    """EntityIds of writers with an announced end."""
    unmatched: deque[FromWriter] = field(default_factory=lambda: deque["FromWriter"](maxlen=_MOST_EARLY))
    """Submessages of undiscovered writers, perhaps never sent again."""
    early: deque[tuple[Service, Data]] = field(
        default_factory=lambda: deque["tuple[Service, Data]"](maxlen=_MOST_EARLY)
    )
    """Requests of clients with an undiscovered reader of responses."""


def require_room(endpoints: Collection[object]) -> None:
    """Raise MessageError if a participant has as many endpoints as we remember."""
    if len(endpoints) >= _MOST_ENDPOINTS:
        raise MessageError(f"a participant of RTPS has more than {_MOST_ENDPOINTS} endpoints of one kind")
