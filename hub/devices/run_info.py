"""The run of a session, as known to a device."""

from __future__ import annotations

from dataclasses import dataclass

from hub.planning.plan import Plan
from schemas.keys import Keys

__all__ = ["RunInfo"]


@dataclass(frozen=True)
class RunInfo:
    """The run of a session, as known to a device."""

    plan: Plan
    keys: Keys
    number: int
    """Tells messages of this run from messages of any other."""
    admission: int = 0
    """The hub's number for this host since it joined; 0 in the hub's own process."""
    live_from_ns: int = 0
    """Simulated time before which the run repeats a recording: devices receive nothing of the repetition."""
