"""How a hand leads the needle: by the needle's own measured pose.

The goal of the holding hand's tip follows from the goal of the needle and the present lie of the needle in
the jaw. So slip in the jaw is made good. SI units, poses in the world.
"""

from __future__ import annotations

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.geometry import Stitch
from controllers.stitching.params import StitchParams
from controllers.stitching.parts import Parts
from controllers.stitching.way_on import in_tissue, present_grip
from robots import rotation
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Leading"]

_UNHELD = 0.3
"""Time without a holder after which the needle is lost, s."""
_LEARNING = 0.15
"""Time constant of learning the lie of the needle in the jaw, s."""


class Leading(Parts):
    """Two hands, and the needle in their jaws."""

    def __init__(self, params: StitchParams, driver: RobotHand, puller: RobotHand) -> None:
        super().__init__((driver, puller))
        self.params = params
        self._needle = params.needle[1].shape

    def sense(self, needle: Vector, holder: float) -> None:
        """Store the measured pose of the needle, shape (7,), and the number of the holding arm."""
        state = self.state
        state.needle[:], state.holder = pose_to_matrix(needle), holder
        state.unheld = 0.0 if holder else state.unheld + self.driver.period

    def _watch(self) -> None:
        """Learn the lie of the needle in the jaw. Raises MotionError for a lost needle."""
        state, hand = self.state, self._holding
        if hand is None:
            return
        if state.unheld > _UNHELD:
            place = ", ".join(f"{1e3 * each:.0f}" for each in state.needle[:3, 3])
            tip = state.needle[:3, :3] @ self._needle.marks[2] + state.needle[:3, 3]
            side = "in the tissue" if in_tissue(self.params, tip) else "outside"
            raise MotionError(
                f"{hand.arm} has lost the needle while it was to {state.phase.name.lower()}: its middle is at"
                f" {place} mm, its tip {side}"
            )
        now = present_grip(hand, state.needle)
        share = hand.period / _LEARNING
        state.grip[:3, 3] += share * (now[:3, 3] - state.grip[:3, 3])
        turn = rotation.log(rotation.from_matrix(now[:3, :3] @ state.grip[:3, :3].T))
        state.grip[:3, :3] = rotation.matrix(rotation.exp(share * turn)) @ state.grip[:3, :3]

    def _learn_grasp(self, hand: RobotHand) -> None:
        """Store the present lie of the needle in a hand's jaw as the hand's hold."""
        self.state.grip[:] = present_grip(hand, self.state.needle)
        self.state.free = False

    def _lead(self, hand: RobotHand, needle: Vector, share: float = 1.0) -> None:
        """Send a hand, on a line, so that its needle comes to a pose, shape (4, 4)."""
        hand.go(matrix_to_pose(needle @ self.state.grip), share)

    def _track_angle(self, hand: RobotHand, stitch: Stitch, angle: float) -> None:
        """Bring the needle to an angle of the way, at once."""
        state, wanted = self.state, stitch.pose(angle)
        goal = matrix_to_pose(wanted @ state.grip)
        hand.state.start[:] = hand.state.goal[:] = goal
        hand.state.duration = hand.state.elapsed = 0.0
        state.angle[0] = angle
        marks = self._needle.marks
        off = marks @ (state.needle[:3, :3] - wanted[:3, :3]).T + state.needle[:3, 3] - wanted[:3, 3]
        state.deviation[0] = float(np.sqrt((off * off).sum(axis=1).max()))
