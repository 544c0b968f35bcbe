"""The jaw, led by a gripper or a button through a ghost: an angle with limited speed of opening and closing.

After jhu-dvrk/sawIntuitiveResearchKit, mtsTeleOperationPSM.cpp: the ghost starts at the jaw's angle and
follows the gripper, slowly until having caught up once, then quickly. So taking over with a closed gripper
does not snap an open jaw shut, and taking over with an open gripper does not drop a held object.
"""

from __future__ import annotations

from enum import IntEnum
from math import radians

from hub.participant import Record, choice, flag, number
from robots.dvrk.instruments import Jaw

__all__ = ["JawGhost"]

_RATE, _RATE_UNTIL_CAUGHT_UP = radians(720.0), radians(36.0)
"""rad/s (mtsIntuitiveResearchKit.h: JawRate, 4 pi; JawRateAfterClutch, 0.2 pi)."""
_CAUGHT_UP = radians(2.0)
"""Largest distance of a ghost caught up with the gripper (same file: JawDifferenceForCaughtUp)."""
_OPEN = radians(45.0)
"""Opening while the button is up (mtsTeleOperationPSM.cpp: of the jaw where the master has no gripper)."""


class Button(IntEnum):
    """Knowledge of the button."""

    UNTOUCHED = -1
    RELEASED = 0
    PRESSED = 1


class JawState(Record):
    """State of the ghost."""

    angle = number()
    """rad."""
    caught_up = flag()
    button = choice(Button.UNTOUCHED)


class JawGhost:
    """The commanded angle of the jaw."""

    def __init__(self, jaw: Jaw) -> None:
        self._lower, self._upper = jaw.lower, jaw.upper
        self.state = JawState()

    @property
    def angle(self) -> float:
        """Of the jaw, rad."""
        return self.state.angle

    def stand_at(self, angle: float) -> None:
        """Start from `angle` (rad), clipped to the jaw's range."""
        self.state.angle = min(max(angle, self._lower), self._upper)
        self.state.caught_up = False

    def press(self, *, pressed: bool) -> None:
        """Note whether the button is down; the button commands the jaw from the first press on."""
        if pressed or self.state.button is not Button.UNTOUCHED:
            self.state.button = Button(pressed)

    def release(self) -> None:
        """Stay, and go slowly at first when the hand takes over again."""
        self.state.caught_up = False

    def follow(self, gripper: float, h: float) -> None:
        """Follow the gripper, 0 closed .. 1 open, for `h` seconds, or the button for a negative gripper.

        Closed is the lower end of the jaw's range, with fingers pressing on each other or on an object. Until
        the first press of the button the jaw stays.
        """
        if gripper >= 0.0:
            goal = self._lower + min(gripper, 1.0) * (self._upper - self._lower)
        elif self.state.button is Button.UNTOUCHED:
            return
        else:
            goal = self._lower if self.state.button is Button.PRESSED else min(_OPEN, self._upper)
        most = h * (_RATE if self.state.caught_up else _RATE_UNTIL_CAUGHT_UP)
        angle = self.state.angle
        self.state.angle = angle + min(max(goal - angle, -most), most)
        if abs(goal - self.state.angle) < _CAUGHT_UP:
            self.state.caught_up = True
