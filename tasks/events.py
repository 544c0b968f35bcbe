"""Events of a task."""

from __future__ import annotations

from typing import Literal, NamedTuple

__all__ = ["Event", "EventKind"]

EventKind = Literal[
    "grasped",
    "lifted",
    "handed over",
    "placed",
    "dropped",
    "out of workspace",
    "out of view",
    "collision",
    "entered",
    "exited",
    "stitched",
    "withdrawn",
    "cut",
    "torn",
    "burnt",
]


class Event(NamedTuple):
    """An event; `thing`, `arm` and `place` are indices into the task's objects, arms and places, -1: none."""

    kind: EventKind
    thing: int = -1
    arm: int = -1
    """Acting arm; after a hand-over the receiving arm."""
    place: int = -1
    """Where the object was placed."""
    value: float = 0.0
    """How much, in `unit`: the height of a lift or drop, the impulse of a collision, the area of a cut."""
    unit: str = ""
