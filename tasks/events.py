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
    "phase",
    "gallbladder grasped",
    "duct clipped",
    "duct cut",
    "artery clipped",
    "artery cut",
    "triangle cleared",
    "plate opened",
    "gallbladder freed",
    "clip closed",
    "cut without clip",
    "cut with too few clips",
    "cut beside clips",
    "cut with short cuff",
    "clipped after cut",
    "wrong structure clipped",
    "wrong structure hurt",
    "clip too near",
    "clip oblique",
    "clip across two",
    "clip not across",
    "clip slipped",
    "clip pulled off",
    "tube torn",
    "gallbladder perforated",
    "grasp torn off",
    "target burnt",
    "energy in the air",
    "energy on an instrument",
    "exchanged while holding",
]


class Event(NamedTuple):
    """An event; `thing`, `arm` and `place` are indices into the task's objects, arms and places, -1: none."""

    kind: EventKind
    thing: int = -1
    arm: int = -1
    """Acting arm; after a hand-over the receiving arm."""
    place: int = -1
    """Place of an object, or organ of an operation."""
    value: float = 0.0
    """How much, in `unit`: the height of a lift or drop, the impulse of a collision, the area of a cut."""
    unit: str = ""
