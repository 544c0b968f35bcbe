"""State of the dissection routine, and the work of the grasper: it takes the gallbladder and lifts it."""

from __future__ import annotations

from math import radians

import numpy as np

from controllers.cholecystectomy.approach import NEAR, choose_pose, withdraw
from controllers.cholecystectomy.grasp_place import grasp_poses
from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.reach import path_margins
from controllers.cholecystectomy.sight import shaft_of
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.cholecystectomy.telling import Telling
from controllers.dissection.hook_hand import HookHand
from controllers.dissection.params import DissectionParams
from controllers.dissection.sight import Sight
from controllers.dissection.step import FAILURES, Failure, Step
from hub.participant import Record, array, choice, flag, integer, number
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.vectors import Vector

__all__ = ["Lifting"]

_BEFORE = 25.0e-3
"""Length of the straight way to the gallbladder, m."""
_GENTLE, _SLOW = 0.3, 0.08
"""Shares of the speed near tissue, and of a pull."""
_SHUT, _PRESSED = 0.0, 0.6
"""Angle of the jaw on tissue (rad), and time to close, s."""
_STRIDE, _CALM = 1.0e-3, 0.3
"""Length of a stride of the pull (m), and time between strides, s."""
_SLACK, _LONG = 0.9, 3.0e-3
"""Share of the least pull below which strides are long, and their length, m."""
_TAUT = 0.3
"""Share of the pull that leads away from the edge of what is tied; the rest turns the flap over it."""
_TURNED = radians(115.0)
"""Angle between bed and flap beyond which it is not turned over farther."""
_MARGIN = 0.08
"""Least share of the joints' ranges that a stride leaves."""
_NECK = 5.0e-3
"""Depth of the end of the gallbladder that counts as its neck, m."""
_COVERS, _REACHED = 25.0e-3, 4.0e-3
"""Distance from the neck of fat that is in the way, and its part that every grasp leaves aside, m."""


class DissectionState(Record):
    """State of the routine."""

    step = choice(Step.AIM_GRASP)
    failure = choice(Failure.NONE)
    clears = flag()
    """Whether fat is cleared; else the plate is freed."""
    whole = number()
    """Area where fat was tied at the beginning, m^2."""
    stripped = flag()
    """Whether the grasper has stripped off what it could."""
    folds = integer()
    """Folds of fat that the grasper has closed on."""
    over = array(3)
    """Direction from a fold over what is tied."""
    inside = flag()
    """Whether the hook is in the tissue."""
    bed = array(3)
    """Direction along the plate at the beginning, from the neck on."""
    ahead = array(3)
    """Direction of the work, from where is free to where it is tied."""
    normal = array(3)
    """Normal of what is tied, towards gallbladder or fat."""
    goal = array(7)
    """Pose of the tip at the tissue, of the hand at work."""
    begun = array(3)
    """Place of the grasper at its grasp, m."""
    place = array(3)
    """Tied place at which the hook works, m."""
    ties = integer()
    before = integer()
    """Tied places when the hook came to its place."""
    heat = number()
    """Heat given before the last step, J."""
    yielded = flag()
    """Whether fat has parted at the present place."""
    idle = number()
    """Time with power that heats nothing, s."""
    deeper = number()
    """Way of the hook beyond its place, m."""
    skipped = integer()
    """Places given up since the last one that parted."""
    elapsed = number()
    """Time in the step, s."""
    since_stride = number()
    pulled = number()
    grasped = flag()
    grasps = integer()
    recoveries = integer()
    rests = array(2, 7)
    """Resting poses of hook and grasper."""
    done = flag()
    failed = flag()


class Lifting(Telling):
    """The grasper."""

    def __init__(self, params: DissectionParams, hook: HookHand, grasper: SurgeonHand) -> None:
        super().__init__()
        self.params, self.hook, self.grasper = params, hook, grasper
        self.state = DissectionState()
        self.sight: Sight | None = None

    @property
    def seen(self) -> Sight:
        """The sight of this step."""
        assert self.sight is not None
        return self.sight

    def enter(self, step: Step) -> None:
        """Begin a step."""
        self.state.step, self.state.elapsed = step, 0.0

    def fail(self, failure: Failure, why: str) -> None:
        """Give up: both hands stay."""
        self.give_up(f": {FAILURES[failure]}: {why}", (self.hook, self.grasper))
        self.state.failure, self.state.failed = failure, True
        self.enter(Step.FAILED)

    def aim_grasp(self) -> None:
        """Choose the pose of the next grasp, and send the grasper there."""
        state, hand, nodes = self.state, self.grasper, self.seen.gallbladder
        along = nodes @ state.bed
        neck = nodes[along < along.min() + _NECK].mean(axis=0)
        neck += self._beyond_fat(neck) * state.bed
        poses = grasp_poses(hand, nodes, neck, state.grasps)
        obstacles = self.seen.obstacles.near(poses[0, :3, 3], NEAR)
        pose = choose_pose(hand, poses, _BEFORE, self.opening, obstacles, "the gallbladder")
        state.goal[:] = matrix_to_pose(pose)
        hand.move_jaw(self.opening)
        hand.go(withdraw(state.goal, _BEFORE))
        self.enter(Step.HOVER_GRASP)

    def _beyond_fat(self, neck: Vector) -> float:
        """Return how far (m) along the gallbladder from its neck the jaws close beside the fat."""
        sheet = self.seen.sheet
        if not len(sheet):
            return 0.0
        covered = sheet[np.linalg.norm(sheet - neck, axis=1) < _COVERS] - neck
        return max(0.0, float((covered @ self.state.bed).max(initial=0.0)) - _REACHED)

    def hover_grasp(self) -> None:
        """Wait before the gallbladder, then go ahead."""
        if self.grasper.has_arrived:
            self.grasper.go(self.state.goal, _GENTLE)
            self.enter(Step.REACH_GRASP)

    def reach_grasp(self) -> None:
        """Wait for the end of the way, then close."""
        if self.grasper.has_arrived and self.grasper.state.waited > _CALM:
            self.grasper.move_jaw(_SHUT)
            self.enter(Step.CLOSE)

    def close(self) -> None:
        """Wait for a hold; without one try again."""
        state, hand = self.state, self.grasper
        if state.elapsed < _PRESSED:
            return
        state.grasps += 1
        if self.seen.is_held:
            state.grasped, state.pulled, state.since_stride = True, 0.0, 0.0
            hand.stay()
            state.begun[:] = hand.measured[:3]
            self.enter(Step.LIFT)
        elif state.grasps >= self.params.attempts:
            self.fail(Failure.GRASP_MISSED, f"nothing is held, {state.grasps} attempts")
        else:
            state.recoveries += 1
            self.say("grasp missed; it is tried again")
            hand.move_jaw(self.opening)
            hand.go(withdraw(state.goal, _BEFORE), _GENTLE)
            self.enter(Step.AIM_GRASP)

    def pull(self) -> bool:
        """Make a stride if the pull is too small or too large; return whether there was none to make."""
        state, hand, (least, most) = self.state, self.grasper, self.params.pull
        state.since_stride += hand.period
        if not state.grasped or not hand.has_arrived or state.since_stride < _CALM:
            return False
        if state.clears:
            return True  # held alone: a pull would carry the fat along
        pull, way = self.seen.pull, self._way()
        if pull > most:
            stride = -_STRIDE
        elif pull < least and state.pulled < self.params.farthest:
            stride = _STRIDE if pull > _SLACK * least else _LONG
        else:
            return True
        goal = hand.line()
        goal[:3] += stride * way
        if path_margins(hand, pose_to_matrix(goal)[None, None])[0][0] < _MARGIN:
            return True
        hand.go(goal, _SLOW)
        state.since_stride = 0.0
        state.pulled = float(np.linalg.norm(goal[:3] - state.begun))
        return False

    @property
    def grasper_shaft(self) -> Obstacles:
        """The grasper's wrist and shaft, which the hook keeps away from."""
        return shaft_of(self.grasper)

    @property
    def opening(self) -> float:
        """Angle of the open jaw, rad."""
        return min(self.grasper.jaw.upper - 0.02, radians(50.0))

    def _way(self) -> Vector:
        """Return the direction of the pull, shape (3,): it turns the flap over the edge of what is tied."""
        state, ties = self.state, self.seen.plate
        edge = ties[(ties @ state.bed).argsort()[:3]].mean(axis=0) if len(ties) else state.place
        flap = self.grasper.line()[:3] - edge
        x, y = float(flap @ state.ahead), float(flap @ state.normal)
        length = max(float(np.hypot(x, y)), 1e-6)
        out = (x * state.ahead + y * state.normal) / length
        turned = np.arctan2(y, -x)
        over = (y * state.ahead - x * state.normal) / length
        share = _TAUT if turned < _TURNED else 1.0
        way = share * out + (1.0 - share) * over
        unit: Vector = way / max(float(np.linalg.norm(way)), 1e-9)
        return unit
