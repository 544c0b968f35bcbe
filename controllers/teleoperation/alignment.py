"""The alignment gate: the arm follows once the hand is turned as the tip is, and is seen to be held.

For masters that cannot be turned by motors; after what mtsTeleOperationPSM.cpp of
jhu-dvrk/sawIntuitiveResearchKit asks of one that can (RunAligningMTM, defaults in mtsIntuitiveResearchKit.h).
The hand is seen to be held when its gripper or its roll has moved enough since it was first to be aligned; a
clutch does not make it prove that again, but demands a closer match.
"""

from __future__ import annotations

from math import atan2, degrees, pi, radians

import numpy as np

from robots import rotation
from schemas.vectors import Vector

__all__ = ["AlignmentGate"]

_TOLERANCE, _TOLERANCE_AFTER_CLUTCH = radians(5.0), radians(2.0)
"""StartOrientationTolerance, OrientationToleranceAfterClutch."""
_GRIPPER, _ROLL, _TOGETHER = radians(40.0), radians(4.0), 0.8
"""StartGripperThreshold, StartRollThreshold, and the share of both that both together must have moved."""
_GRIPPER_OPEN = radians(60.0)
"""GripperMax: how far a master's gripper is open at 1."""
_PATIENCE = 2.0
"""s, from one warning to the next."""


class AlignmentGate:
    """Whether the hand may take over. All that changes is in `state`."""

    def __init__(self) -> None:
        """Start closed."""
        self.state = np.zeros(13)
        (
            self._held,
            self._passed,
            self._watching,
            self._waited,
            self._first,
            self._roll,
            self._gripper,
            self._angle,
        ) = np.split(self.state, [1, 2, 3, 4, 8, 10, 12])

    def reset(self) -> None:
        """Forget the hand: it must be seen to be held again."""
        self.state[:] = 0.0

    def clutch(self) -> None:
        """Close the gate, not forgetting that the hand was seen to be held."""
        self._watching[0] = self._waited[0] = 0.0

    def check(self, hand: Vector, tip: Vector, gripper: float, h: float) -> bool:
        """Return whether the hand may take over.

        Args:
            hand: orientation of the hand in the arm's base frame, quaternion (x, y, z, w).
            tip: orientation of the tip, likewise.
            gripper: of the hand, 0 closed .. 1 open; negative without one.
            h: time since the last look, s.
        """
        self._watch(hand, _GRIPPER_OPEN * max(gripper, 0.0))
        self._waited[0] += h
        self._angle[0] = np.linalg.norm(rotation.log(rotation.product(rotation.conjugate(tip), hand)))
        if self._held[0] and self._angle[0] <= self._tolerance:
            self._passed[0] = 1.0
            self.clutch()
            return True
        return False

    def complaint(self) -> str:
        """Return what the user is to do, every two seconds that the gate stays closed; else nothing."""
        if self._waited[0] < _PATIENCE:
            return ""
        self._waited[0] = 0.0
        if self._angle[0] > self._tolerance:
            away, allowed = degrees(self._angle[0]), degrees(self._tolerance)
            return (
                f"the hand is turned {away:.1f} deg away from the instrument, allowed are {allowed:g}; turn"
                " it as the instrument is"
            )
        return (
            f"nobody seems to hold the master; roll it by {degrees(_ROLL):g} deg, or move its gripper by"
            f" {degrees(_GRIPPER):g}"
        )

    @property
    def _tolerance(self) -> float:
        return _TOLERANCE_AFTER_CLUTCH if self._passed[0] else _TOLERANCE

    def _watch(self, hand: Vector, gripper: float) -> None:
        """Take how far roll (about the hand's own z) and gripper have moved, rad."""
        if not self._watching[0]:
            self._watching[0] = 1.0
            self._first[:], self._roll[:], self._gripper[:] = hand, 0.0, gripper
        turned = rotation.product(rotation.conjugate(self._first), hand)
        roll = (2.0 * atan2(turned[2], turned[3]) + pi) % (2.0 * pi) - pi
        self._roll[:] = min(self._roll[0], roll), max(self._roll[1], roll)
        self._gripper[:] = min(self._gripper[0], gripper), max(self._gripper[1], gripper)
        rolled, moved = self._roll[1] - self._roll[0], self._gripper[1] - self._gripper[0]
        if moved >= _GRIPPER or rolled >= _ROLL or moved + rolled > _TOGETHER * (_GRIPPER + _ROLL):
            self._held[0] = 1.0
