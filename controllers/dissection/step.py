"""Steps of the dissection routine, and its reasons to give up."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["FAILURES", "Failure", "Step"]


class Step(IntEnum):
    """What the routine does."""

    AIM_GRASP = 0
    HOVER_GRASP = 1
    """The grasper is on its way to a place before the gallbladder, its jaw open."""
    REACH_GRASP = 2
    CLOSE = 3
    LIFT = 4
    """The grasper pulls until the plate is under tension."""
    PLAN = 5
    """The next place of the hook is chosen."""
    HOVER = 6
    """The hook is on its way to a place before the tissue."""
    REACH = 7
    RAISE = 8
    """The hook lifts the fat without power."""
    BURN = 9
    LEAVE = 10
    DONE = 11
    FAILED = 12
    AIM_FOLD = 13
    """The grasper strips fat off first: the next fold is chosen."""
    HOVER_FOLD = 14
    REACH_FOLD = 15
    PINCH = 16
    STRIP = 17
    RELEASE_FOLD = 18


class Failure(IntEnum):
    """Reason to give up."""

    NONE = 0
    GRASP_MISSED = 1
    GRASP_SLIPPED = 2
    NOT_PARTED = 3
    OUT_OF_REACH = 4
    REFUSED = 5


FAILURES = {
    Failure.GRASP_MISSED: "grasp missed",
    Failure.GRASP_SLIPPED: "grasp slipped",
    Failure.NOT_PARTED: "not parted",
    Failure.OUT_OF_REACH: "out of reach",
    Failure.REFUSED: "command refused",
}
"""Words for each failure."""
