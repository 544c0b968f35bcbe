"""A program on the domain, as the RTPS participant of services and subscriptions remembers it."""

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
"""Of each kind: whatever is sent on the domain, memory is limited."""


@dataclass(slots=True)
class ParticipantProxy:
    """A remote participant, and our endpoints that are matched with its own."""

    metatraffic: tuple[str, int]
    """Address where it receives SPDP and SEDP."""
    default: tuple[str, int]
    """Address where it receives all else."""
    announced_s: float
    """When it announced itself last, by the monotonic clock."""
    readers: dict[bytes, StatefulReader] = field(default_factory=dict[bytes, StatefulReader])
    """By EntityId of the remote writer."""
    writers: dict[tuple[bytes, bytes], StatefulWriter] = field(
        default_factory=dict[tuple[bytes, bytes], StatefulWriter]
    )
    """By EntityIds of our writer and the remote reader."""
    publications: dict[bytes, bytes] = field(default_factory=dict[bytes, bytes])
    """Topics, as parameters have them, by EntityId of the remote writer."""
    gone: deque[bytes] = field(default_factory=lambda: deque[bytes](maxlen=_MOST_ENDPOINTS))
    """EntityIds of writers that have announced their end."""
    unmatched: deque[FromWriter] = field(default_factory=lambda: deque["FromWriter"](maxlen=_MOST_EARLY))
    """What writers have sent that are not discovered yet: they may not send it again."""
    early: deque[tuple[Service, Data]] = field(
        default_factory=lambda: deque["tuple[Service, Data]"](maxlen=_MOST_EARLY)
    )
    """Requests of clients whose readers of responses are not discovered yet."""


def require_room(endpoints: Collection[object]) -> None:
    """Raise MessageError if a participant has as many endpoints as we remember."""
    if len(endpoints) >= _MOST_ENDPOINTS:
        raise MessageError(f"a participant of RTPS has more than {_MOST_ENDPOINTS} endpoints of one kind")
