"""Steps at the gallbladder: grasp, and pull aside until duct and artery are taut."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.approach import NEAR, choose_pose, withdraw
from controllers.cholecystectomy.grasp_place import grasp_poses
from controllers.cholecystectomy.procedure import Procedure, opening
from controllers.cholecystectomy.sub_task import Failure, Step
from robots.transform import matrix_to_pose
from schemas.vectors import Vector

__all__ = ["Grasping"]

BEFORE_GRASP = 25.0e-3
"""Length of the straight way to the gallbladder, m."""
_SHUT = 0.0
_PRESSED = 0.6
"""Time for the jaw to close on tissue, s."""
_STRIDE, _SLOW = 1.0e-3, 0.08
"""Length of a stride when the gallbladder is pulled aside (m), and its share of the speed."""
_STRAIGHT = 1.02
"""Present length of a taut tube over the distance of its ends."""
_SWINGS = ((1.0, 0.0, 6.0e-3), (0.0, 1.0, 6.0e-3), (0.0, -1.0, 12.0e-3))
"""Pulls elsewhere in their order: shares towards the hand's port and to its side, and length, m."""
_HARD = 1.3
"""Share of the largest pull beyond which the gallbladder is given way."""
_CALM = 0.3
"""Time between the last stride and the next work, s."""


class Grasping(Procedure):
    """Grasp and retraction."""

    def aim_grasp(self) -> None:
        """Choose the pose of the next grasp, and send the grasper there."""
        state, hand, seen = self.state, self.hands.grasper, self.seen
        poses = grasp_poses(hand, seen.gallbladder, seen.tube(0).points[0], state.attempts)
        obstacles = seen.obstacles(hand, self.hands, None).near(poses[0, :3, 3], NEAR)
        pose = choose_pose(hand, poses, BEFORE_GRASP, opening(hand), obstacles, "the gallbladder")
        state.goal[:] = matrix_to_pose(pose)
        hand.move_jaw(opening(hand))
        hand.go(withdraw(state.goal, BEFORE_GRASP))
        self.enter(Step.HOVER)

    def close_on_gallbladder(self) -> None:
        """Wait for a hold, and begin to pull; without one try again."""
        state, hand = self.state, self.hands.grasper
        if state.elapsed == 0.0:
            hand.move_jaw(_SHUT)
        if state.elapsed < _PRESSED:
            return
        if self.seen.is_held:
            state.grasped, state.taut, state.pulled = True, False, 0.0
            hand.stay()
            self.enter(Step.RETRACT)
        else:
            self.retry(Failure.GRASP_MISSED, "nothing is held")

    def retract(self) -> None:
        """Pull the gallbladder away from the far ends of the tubes, stride by stride."""
        state, hand, (least, most) = self.state, self.hands.grasper, self.params.pull
        if not hand.has_arrived:
            return
        pull, goal = self.seen.pull, hand.line()
        straight = any(self.seen.tube(tube).slack < _STRAIGHT for tube in range(2) if not state.parted[tube])
        if state.swing > 0.0 and pull < _HARD * most:
            towards, aside, _ = _SWINGS[state.pulls - 1]
            goal[:3] += _STRIDE * (np.array([towards, aside]) @ self._sideways())
            state.swing -= _STRIDE
            hand.go(goal, _SLOW)
            state.elapsed = 0.0
            return
        if pull > _HARD * most and state.pulled > 0.0:
            stride = -_STRIDE
        elif pull < most and not (straight and pull >= least) and state.pulled < self.params.farthest:
            stride = _STRIDE
        elif state.elapsed < _CALM:
            return
        else:
            state.taut = True
            self.say(f"the gallbladder is pulled {1e3 * state.pulled:.0f} mm aside with {pull:.2f} N")
            self.enter(Step.PLAN)
            return
        goal[:3] += stride * self._aside()
        state.pulled += stride
        hand.go(goal, _SLOW)
        state.elapsed = 0.0

    def pull_elsewhere(self, why: str) -> bool:
        """Pull the gallbladder to another side, which may open a way; return False if all were tried."""
        state = self.state
        if state.pulls >= len(_SWINGS) or state.parted[state.tube] or not state.grasped:
            return False
        state.swing, state.taut = _SWINGS[state.pulls][2], False
        state.pulls += 1
        state.recoveries += 1
        self.say(f"{why}; the gallbladder is pulled elsewhere")
        self.enter(Step.RETRACT)
        return True

    def _sideways(self) -> Vector:
        """Return two directions across the pull, towards the hand's port and to its side, shape (2, 3)."""
        aside, hand = self._aside(), self.hands.grasper
        up = hand.base[:3, 3] - hand.line()[:3]
        up -= (up @ aside) * aside
        up /= max(float(np.linalg.norm(up)), 1e-9)
        return np.stack([up, np.cross(aside, up)])

    def _aside(self) -> Vector:
        """Return the direction of the pull, away from the far ends of the tubes still whole, shape (3,)."""
        tubes = [self.seen.tube(tube) for tube in range(2) if not self.state.parted[tube]]
        ways = [tube.points[0] - tube.points[-1] for tube in tubes] or [np.array([-1.0, 0.0, 0.0])]
        way: Vector = np.sum([each / max(float(np.linalg.norm(each)), 1e-9) for each in ways], axis=0)
        return way / max(float(np.linalg.norm(way)), 1e-9)
