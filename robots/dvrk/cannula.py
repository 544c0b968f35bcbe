"""How deep an instrument or endoscope must be before its tip may be commanded.

It must be past its cannula, and away from the remote centre (RCM).

Near the RCM a small motion of the tip asks for a large one of the joints, and in the cannula there is no room
for it. Source: SAW = jhu-dvrk/sawIntuitiveResearchKit. For a PSM it is about the distance of the end of its
shaft from the RCM, where roll and wrist meet (mtsIntuitiveResearchKitPSM.cpp, is_safe_for_cartesian_control
and InverseKinematics; numbers in mtsIntuitiveResearchKit.h), for the ECM about its insertion
(mtsIntuitiveResearchKitECM.h and .cpp). SI units.
"""

from __future__ import annotations

from dataclasses import dataclass

from robots.dvrk import ecm, si
from robots.limits import TOLERANCE, distinct
from robots.serial_chain import SerialChain
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Cannula"]

_PSM_SAFE, _PSM_BUFFER = 0.045, 0.002
"""m: nearest goal, and by how much nearer Cartesian control may begin (SafeDistanceFromRCM,
SafeDistanceFromRCMBuffer).
"""
_ECM_SAFE, _ECM_START = 0.040, 0.050
"""m: nearest goal, and insertion beyond which Cartesian control may begin."""
_INSERTION = 2
"""Index of the joint."""


@dataclass(frozen=True)
class Cannula:
    """The rule for an arm. Depths count from the RCM, m, inwards."""

    what: str
    offset: float
    """Depth beyond the insertion."""
    start: float
    """Least depth for Cartesian control to begin."""
    safe: float
    """Least depth of a goal."""

    @classmethod
    def of(cls, chain: SerialChain) -> Cannula:
        """Return the rule for a PSM or the ECM."""
        insertion, roll = chain.joints[_INSERTION : _INSERTION + 2]
        if chain.joints in (ecm.JOINTS, si.ECM_JOINTS):
            return cls("the endoscope's insertion", 0.0, _ECM_START, _ECM_SAFE)
        return cls(
            "the end of the instrument's shaft", insertion.d + roll.d, _PSM_SAFE - _PSM_BUFFER, _PSM_SAFE
        )

    def depth(self, q: Vector) -> float:
        """Return the depth at joint positions `q`, shape (n,)."""
        return float(q[_INSERTION]) + self.offset

    def not_past(self, q: Vector) -> str:
        """Return why Cartesian control cannot begin at `q`, shape (n,); empty if it can."""
        if (depth := self.depth(q)) >= self.start - TOLERANCE:
            return ""
        value, allowed = distinct(depth, self.start, digits=4)
        return (
            f"{self.what} is {value} m past the remote centre, allowed from {allowed} on; insert it in joint"
            " space first"
        )

    def check(self, goal: Vector, q: Vector) -> None:
        """Raise MotionError if `goal` is too near to the remote centre.

        It is not if it is no nearer than `q`, where the arm is, within the tolerance; both have shape (n,).
        """
        depth = self.depth(goal)
        if depth < min(self.safe, self.depth(q)) - TOLERANCE:
            value, allowed = distinct(depth, self.safe, digits=4)
            raise MotionError(
                f"{self.what} would be {value} m past the remote centre, allowed from {allowed} on"
            )
