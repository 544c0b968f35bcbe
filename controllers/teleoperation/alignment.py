"""The alignment gate: the arm follows once a held master has the orientation of the tip.

For masters without motors; after the rules of mtsTeleOperationPSM.cpp of jhu-dvrk/sawIntuitiveResearchKit for
masters with motors (RunAligningMTM, defaults in mtsIntuitiveResearchKit.h). A master counts as held when
gripper or roll have moved enough since alignment began. After a clutch the motion need not be shown again,
but the orientations must match more closely.
"""

from __future__ import annotations

from math import atan2, degrees, pi, radians

import numpy as np

from hub.participant import Record, array, flag, number
from robots import rotation
from robots.limits import distinct
from schemas.vectors import Vector

__all__ = ["AlignmentGate"]

_TOLERANCE, _TOLERANCE_AFTER_CLUTCH = radians(5.0), radians(2.0)
"""StartOrientationTolerance, OrientationToleranceAfterClutch."""
_GRIPPER, _ROLL, _TOGETHER = radians(40.0), radians(4.0), 0.8
"""StartGripperThreshold, StartRollThreshold, and the fraction of both required of both together."""
_GRIPPER_OPEN = radians(60.0)
"""GripperMax: how far a master's gripper is open at 1."""
_PATIENCE = 2.0
"""Time between two warnings, s."""


class AlignmentState(Record):
    """State of the gate; angles in rad."""

    held = flag()
    """Whether a hand holds the master."""
    passed = flag()
    """Whether the gate was open before."""
    watching = flag()
    """Whether the extremes below belong to the present alignment."""
    waited = number()
    """s since alignment began, or since the last warning."""
    first = array(4)
    """Orientation of the master when alignment began, quaternion (x, y, z, w)."""
    roll_least = number()
    roll_most = number()
    gripper_least = number()
    gripper_most = number()
    angle = number()
    """Angle between master and tip."""


class AlignmentGate:
    """Whether the hand may take over."""

    def __init__(self) -> None:
        """Start closed."""
        self.state = AlignmentState()

    def reset(self) -> None:
        """Close the gate; a hand on the master must be shown again."""
        self.state.values[:] = 0.0

    def clutch(self) -> None:
        """Close the gate; the master still counts as held."""
        self.state.watching, self.state.waited = False, 0.0

    def check(self, hand: Vector, tip: Vector, gripper: float, h: float) -> bool:
        """Return whether the hand may take over.

        Args:
            hand: orientation of the master in the arm's base frame, quaternion (x, y, z, w).
            tip: orientation of the tip, likewise.
            gripper: gripper of the master, 0 closed .. 1 open; negative: no gripper.
            h: time since the last check, s.
        """
        self._watch(hand, _GRIPPER_OPEN * max(gripper, 0.0))
        state = self.state
        state.waited += h
        state.angle = float(np.linalg.norm(rotation.log(rotation.product(rotation.conjugate(tip), hand))))
        if state.held and state.angle <= self._tolerance:
            state.passed = True
            self.clutch()
            return True
        return False

    def warning(self) -> str:
        """Return an instruction for the user, every two seconds of a closed gate; else an empty text."""
        state = self.state
        if state.waited < _PATIENCE:
            return ""
        state.waited = 0.0
        if state.angle > self._tolerance:
            away, allowed = distinct(degrees(state.angle), degrees(self._tolerance), digits=3)
            return (
                f"the master is turned {away} deg away from the instrument, allowed are {allowed}; turn it"
                " as the instrument is"
            )
        return (
            f"no hand seems to hold the master; roll it by {degrees(_ROLL):g} deg, or move its gripper by"
            f" {degrees(_GRIPPER):g}"
        )

    @property
    def _tolerance(self) -> float:
        return _TOLERANCE_AFTER_CLUTCH if self.state.passed else _TOLERANCE

    def _watch(self, hand: Vector, gripper: float) -> None:
        """Record how far roll (about the master's own z) and gripper have moved, rad."""
        state = self.state
        if not state.watching:
            state.watching = True
            state.first[:] = hand
            state.roll_least = state.roll_most = 0.0
            state.gripper_least = state.gripper_most = gripper
        turned = rotation.product(rotation.conjugate(state.first), hand)
        roll = (2.0 * atan2(turned[2], turned[3]) + pi) % (2.0 * pi) - pi
        state.roll_least, state.roll_most = min(state.roll_least, roll), max(state.roll_most, roll)
        state.gripper_least = min(state.gripper_least, gripper)
        state.gripper_most = max(state.gripper_most, gripper)
        rolled, moved = state.roll_most - state.roll_least, state.gripper_most - state.gripper_least
        if moved >= _GRIPPER or rolled >= _ROLL or moved + rolled > _TOGETHER * (_GRIPPER + _ROLL):
            state.held = True
