"""What all hands share: the things as measured, what was tried with them, and how far the task is."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from hub.participant import Record, array, flag, integer
from schemas.vectors import Vector

__all__ = ["Progress", "Seen", "Verdict"]

_SPEED = 5.0e-3
"""Of a thing that lies still, m/s."""
_STILL = 0.15
"""s for which a thing has been still before it is taken."""


class Verdict(IntEnum):
    """Why a thing is left where it is."""

    NONE = 0
    """It is not."""
    NOT_REACHABLE = 1
    """No hand that may take it has a way to."""
    LOST = 2
    """It has fallen off the table."""
    BLOCKED = 3
    """Jaws have closed on it too often without bringing it to its place."""


class Progress(Record):
    """Of the task."""

    done = flag()
    over = flag()
    """Whether nothing more can be done."""
    leg = integer()
    """From 0; even: to the targets, odd: back."""
    placed = integer()
    """How many things are where they belong."""
    attempts = integer()
    """How often a jaw has closed on a thing."""
    dropped = integer()
    """How often a thing was not held any more on its way."""
    not_reachable = integer()
    lost = integer()
    blocked = integer()
    """How many things have this verdict now."""


class Seen(Record):
    """The things as they are measured, by index, and what was tried with each."""

    poses = array("n", 4, 4)
    holders = array("n")
    """Number of the arm that holds each, 0: none."""
    still = array("n")
    """s for which each has lain still."""
    tries = array("n")
    """How often a jaw has closed on each in this leg, or has struck something on its way down to it."""
    verdicts = array("n")
    said = array("n")
    """The verdicts that have been published."""

    def take(self, thing: int, pose: Vector, holder: float, period: float) -> None:
        """Take what is measured of a thing: its pose, shape (4, 4), and the number of its holder."""
        moved = float(np.linalg.norm(pose[:3, 3] - self.poses[thing, :3, 3]))
        self.still[thing] = 0.0 if moved > _SPEED * period else self.still[thing] + period
        self.poses[thing], self.holders[thing] = pose, holder
        if not self.still[thing] and self.verdicts[thing] == Verdict.NOT_REACHABLE:
            self.verdicts[thing] = Verdict.NONE

    def is_free(self, thing: int) -> bool:
        """Say whether a thing lies still and may be taken."""
        return self.still[thing] > _STILL and not self.holders[thing] and self.verdicts[thing] == Verdict.NONE
