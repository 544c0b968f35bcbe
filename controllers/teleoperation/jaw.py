"""The jaw, led by a gripper or a button through a ghost that keeps it from snapping.

After jhu-dvrk/sawIntuitiveResearchKit, mtsTeleOperationPSM.cpp: the ghost starts where the jaw is and goes
after the gripper, slowly until it has caught up once, quickly from then on; so a gripper that is closed when
it takes over an open jaw drops nothing, and pinches nobody.
"""

from __future__ import annotations

from math import radians

import numpy as np

from robots.dvrk.instruments import Jaw

__all__ = ["JawGhost"]

_RATE, _RATE_UNTIL_CAUGHT_UP = radians(720.0), radians(36.0)
"""rad/s (mtsIntuitiveResearchKit.h: JawRate, 4 pi; JawRateAfterClutch, 0.2 pi)."""
_CAUGHT_UP = radians(2.0)
"""Distance at which the ghost has caught up (same file: JawDifferenceForCaughtUp)."""
_OPEN = radians(45.0)
"""Opening while the button is up (mtsTeleOperationPSM.cpp: of the jaw where the master has no gripper)."""

_UNTOUCHED = -1.0


class JawGhost:
    """The angle that the jaw is told. All that changes is in `state`."""

    def __init__(self, jaw: Jaw) -> None:
        """Take the jaw's range."""
        self._lower, self._upper = jaw.lower, jaw.upper
        self.state = np.zeros(3)
        self.angle = self.state[:1]
        """rad, shape (1,)."""
        self._caught_up, self._pressed = self.state[1:2], self.state[2:]
        self._pressed[0] = _UNTOUCHED

    def stand_at(self, angle: float) -> None:
        """Start from `angle` (rad), or as near to it as the jaw's range allows."""
        self.angle[0] = min(max(angle, self._lower), self._upper)
        self._caught_up[0] = 0.0

    def press(self, *, pressed: bool) -> None:
        """Note whether the button is down. Until it was pressed once nobody has meant the jaw."""
        if pressed or self._pressed[0] != _UNTOUCHED:
            self._pressed[0] = pressed

    def release(self) -> None:
        """Stay, and go slowly at first when the hand is back."""
        self._caught_up[0] = 0.0

    def follow(self, gripper: float, h: float) -> None:
        """Go after the hand for `h` seconds: after the gripper, 0 closed .. 1 open, or the button if that is
        negative.

        Closed is the lower end of the jaw's range, where the fingers press on what is between them. Until the
        button is pressed the jaw stays.
        """
        if gripper >= 0.0:
            goal = self._lower + min(gripper, 1.0) * (self._upper - self._lower)
        elif self._pressed[0] == _UNTOUCHED:
            return
        else:
            goal = self._lower if self._pressed[0] else min(_OPEN, self._upper)
        most = h * (_RATE if self._caught_up[0] else _RATE_UNTIL_CAUGHT_UP)
        angle = float(self.angle[0])
        self.angle[0] = angle + min(max(goal - angle, -most), most)
        if abs(goal - self.angle[0]) < _CAUGHT_UP:
            self._caught_up[0] = 1.0
