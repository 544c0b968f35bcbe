"""The run of a session that a device takes part in."""

from __future__ import annotations

from dataclasses import dataclass

from hub.planning.plan import Plan
from schemas.keys import Keys

__all__ = ["RunInfo"]


@dataclass(frozen=True)
class RunInfo:
    """The run of a session that a device takes part in."""

    plan: Plan
    keys: Keys
    number: int
    """Tells the messages of this run from those of any other."""
    admission: int = 0
    """The number that the hub has given to this host when it joined; 0 in the hub's own process."""
    live_from_ns: int = 0
    """Simulated time before which the run repeats a recorded one: devices receive nothing of that."""
