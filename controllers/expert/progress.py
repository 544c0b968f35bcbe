"""State shared by all hands: measured objects, attempts, and progress of the task."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from hub.participant import Record, array, flag, integer
from schemas.vectors import Vector

__all__ = ["ObservedObjects", "Progress", "Verdict"]

_SPEED = 5.0e-3
"""Largest speed of an object at rest, m/s."""
_STILL = 0.15
"""Time at rest before a grasp, s."""


class Verdict(IntEnum):
    """Reason to leave an object."""

    NONE = 0
    """No reason: the object is still to be carried."""
    NOT_REACHABLE = 1
    """No eligible hand has a feasible grasp."""
    LOST = 2
    """The object has fallen off the table."""
    BLOCKED = 3
    """Too many grasps have failed."""


class Progress(Record):
    """Progress of the task."""

    done = flag()
    over = flag()
    """Whether nothing more can be done."""
    leg = integer()
    """Number of the leg, from 0; even: to the targets, odd: back."""
    placed = integer()
    """Number of objects at their targets."""
    attempts = integer()
    """Number of grasps."""
    dropped = integer()
    """Number of objects lost on their way."""
    not_reachable = integer()
    lost = integer()
    blocked = integer()
    """Number of objects with this verdict now."""


class ObservedObjects(Record):
    """Measured objects by index, and the attempts on each."""

    poses = array("n", 4, 4)
    holders = array("n")
    """Number of the arm holding each object, 0: none."""
    still = array("n")
    """Time of each object at rest, s."""
    tries = array("n")
    """Number of grasps and collisions in this leg, by object."""
    verdicts = array("n")
    said = array("n")
    """Published verdicts."""

    def observe(self, index: int, pose: Vector, holder: float, period: float) -> None:
        """Store an object's measured pose, shape (4, 4), and the number of the holding arm."""
        moved = float(np.linalg.norm(pose[:3, 3] - self.poses[index, :3, 3]))
        self.still[index] = 0.0 if moved > _SPEED * period else self.still[index] + period
        self.poses[index], self.holders[index] = pose, holder
        if not self.still[index] and self.verdicts[index] == Verdict.NOT_REACHABLE:
            self.verdicts[index] = Verdict.NONE

    def is_free(self, index: int) -> bool:
        """Return whether an object is at rest and open to a grasp."""
        return self.still[index] > _STILL and not self.holders[index] and self.verdicts[index] == Verdict.NONE
