"""The procedure of two hands at a needle; measurements end each phase. SI units, poses in the world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import radians

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.feasibility import best_reach
from controllers.stitching.geometry import Stitch, approach_pose
from controllers.stitching.handing import Hold
from controllers.stitching.leading import Leading
from controllers.stitching.params import StitchParams
from controllers.stitching.phase import StitchPhase
from controllers.stitching.plan import BEFORE, BEYOND, driving_poses
from controllers.stitching.rejoin import BACK, OPEN, OPENED, SHUT, Rejoin
from controllers.stitching.way_on import WayOn, behind_tip, present_grip, way_on
from robots.transform import pose_to_matrix
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["ATTEMPTS", "HOVER", "Procedure"]

HOVER = 0.020
"""Distance against the fingers, m: before the driver picks the needle up, and on the way down."""
_ACCURATE, _ALIGNED = 0.15e-3, 0.20e-3
"""m: accuracy of a tip that takes hold; accuracy of the needle before the entry."""
_PATIENCE = 1.5
"""Patience for these accuracies, s; then the procedure goes on with the present accuracy."""
_PRESSED = 0.5
"""s: for a jaw to close."""
_HELD_OPEN = 0.02
"""rad: a jaw commanded to shut but at least this far open has an object between the fingers."""
_GENTLE = 0.35
_PULL_SPEED = radians(45.0)
"""rad/s."""
ATTEMPTS = 3
"""Attempts to take hold of the needle, and to continue after a loss."""


class Procedure(Leading, ABC):
    """Two hands and a needle; subclasses choose the stitches and the phases before and after."""

    def __init__(self, params: StitchParams, driver: RobotHand, puller: RobotHand) -> None:
        super().__init__(params, driver, puller)
        self.rejoin = Rejoin(driver, puller)
        self._status: list[str] = []
        self._steps: dict[StitchPhase, Callable[[], None]] = {
            StitchPhase.BEGIN: self._begin,
            StitchPhase.HOVER: self._hover_over_needle,
            StitchPhase.DESCEND: self._descend,
            StitchPhase.CLOSE: self._close,
            StitchPhase.LIFT: self._lift,
            StitchPhase.APPROACH: self._approach_skin,
            StitchPhase.ALIGN: self._align,
            StitchPhase.DRIVE: self._drive,
            StitchPhase.COME: lambda: self._come(StitchPhase.TAKE),
            StitchPhase.TAKE: lambda: self._take_over(StitchPhase.HOLD),
            StitchPhase.HOLD: lambda: self._hold(StitchPhase.RELEASE),
            StitchPhase.RELEASE: lambda: self._release(StitchPhase.LEAVE),
            StitchPhase.LEAVE: self._leave,
            StitchPhase.PULL: self._pull,
            StitchPhase.RAISE: self._raise,
            StitchPhase.PRESENT: self._present,
            StitchPhase.COME_BACK: lambda: self._come(StitchPhase.TAKE_BACK),
            StitchPhase.TAKE_BACK: lambda: self._take_over(StitchPhase.HOLD_BACK),
            StitchPhase.HOLD_BACK: lambda: self._hold(StitchPhase.RELEASE_BACK),
            StitchPhase.RELEASE_BACK: lambda: self._release(StitchPhase.LEAVE_BACK),
            StitchPhase.LEAVE_BACK: self._leave_back,
            StitchPhase.LET_GO: self._let_go,
            StitchPhase.STEP_BACK: self._step_back,
            StitchPhase.DONE: lambda: None,
            StitchPhase.FAILED: lambda: None,
        }

    @property
    @abstractmethod
    def stitch(self) -> Stitch:
        """The stitch at work. Raises MotionError if the stitch is not feasible."""

    @abstractmethod
    def _begin(self) -> None:
        """Perform the phase before the first stitch."""

    @abstractmethod
    def _raise(self) -> None:
        """Perform the phase after the needle is out and raised."""

    @abstractmethod
    def _recover(self, why: str) -> None:
        """Go on, or do not, after a failure."""

    def statuses(self) -> tuple[str, ...]:
        """Return and clear the statuses of this step."""
        said = tuple(self._status)
        self._status.clear()
        return said

    def step(self) -> None:
        """Advance the procedure."""
        state = self.state
        try:
            self._watch()
            if self.rejoin.is_under_way:
                self._come_back()
            else:
                self._steps[state.phase]()
        except MotionError as error:
            self._recover(str(error))

    def _way_on(self) -> WayOn:
        return way_on(self.params, *self.hands, self.stitch, self.state.needle, self.state.holder)

    @property
    def _present_hold(self) -> Hold | None:
        """The holding hand and the grip; None if no arm holds the needle.

        Raises MotionError if the arm with the needle is neither driver nor puller.
        """
        for hand in self.hands:
            if hand.number == self.state.holder:
                grip = present_grip(hand, self.state.needle)
                return Hold(hand, grip, behind_tip(grip, hand, self.stitch))
        if self.state.holder:
            Procedure._way_on(self)  # says that it is neither
        return None

    def _follow(self, plan: WayOn) -> None:
        """Let the hands go to where a plan goes on."""
        state = self.state
        self._assign(plan)
        state.planned[0], state.planned[1] = plan.driver, plan.puller
        state.angle[0], state.attempts, state.failed[0] = plan.angle, 0, 0.0
        state.picked_for, state.free = plan.picked_for, plan.holder is None
        if plan.holder is not None:
            self._learn_grasp(plan.holder)
        self.rejoin.begin(plan, state.grip, state.park)
        self._enter(StitchPhase.BEGIN)

    def _come_back(self) -> None:
        """Let the hands go on to where the stitch goes on."""
        self.rejoin.step(self.state.needle)
        if not self.rejoin.is_under_way:
            self._enter(self.rejoin.state.then)

    def _enter(self, phase: StitchPhase) -> None:
        self.state.phase, self.state.waited = phase, 0.0

    def _has_arrived(self, hand: RobotHand, within: float | None = None) -> bool:
        """Return whether a hand is at its goal, as near as possible."""
        if not hand.has_arrived:
            return False
        self.state.waited += hand.period
        return within is None or hand.error <= within or self.state.waited > _PATIENCE

    def _pick_pose(self, away: float) -> Vector:
        """Return the tip's pose, shape (7,), for picking the needle up, or so far before."""
        grip = self.handing.pick if self.handing.pending else self.state.planned[0]
        return approach_pose(self.state.needle @ grip, away)

    def _hover_over_needle(self) -> None:
        hand = self._picker
        if self._has_arrived(hand, _ACCURATE):
            hand.go(self._pick_pose(0.0), _GENTLE)
            self._enter(StitchPhase.DESCEND)

    def _descend(self) -> None:
        hand = self._picker
        if self._has_arrived(hand, _ACCURATE):
            hand.move_jaw(SHUT)
            self.state.attempts += 1
            self._enter(StitchPhase.CLOSE)

    def _close(self) -> None:
        state, hand = self.state, self._picker
        if not self._has_arrived(hand) or state.waited < _PRESSED:
            return
        if state.holder and hand.angle > _HELD_OPEN:
            state.attempts = 0
            self._learn_grasp(hand)
            if state.picked_for is StitchPhase.LIFT:
                goal = hand.line()
                goal[:3] += self.params.lift * self.params.phantom.pose[:3, 2]
                hand.go(goal)
            else:  # in the tissue: back to its way
                self._lead(hand, self.stitch.pose(state.angle[0]), _GENTLE)
            self._enter(state.picked_for)
        elif state.attempts >= ATTEMPTS:
            raise MotionError(f"{hand.arm} could not take the needle up in {ATTEMPTS} attempts")
        else:
            hand.move_jaw(OPEN)
            hand.go(self._pick_pose(HOVER))
            self._enter(StitchPhase.HOVER)

    def _lift(self) -> None:
        if not self._has_arrived(self._picker):
            return
        if self.handing.pending:
            self._to_present(self._picker)
            self.handing.pending = False
        else:
            self._to_approach()

    def _to_present(self, hand: RobotHand) -> None:
        """Let the holding hand bring the needle to the next hand-over."""
        self._lead(hand, self.handing.needles[self.handing.left])
        self._enter(StitchPhase.PRESENT)

    def _to_approach(self) -> None:
        stitch = self.stitch
        self._status.append(f"stitch {self.state.stitch}")
        self._lead(self.driver, stitch.pose(stitch.entry - BEFORE, self.params.lift))
        self._enter(StitchPhase.APPROACH)

    def _approach_skin(self) -> None:
        if self._has_arrived(self.driver):
            stitch = self.stitch
            self._require_reach(stitch)
            self.state.angle[0] = stitch.entry - BEFORE
            self._lead(self.driver, stitch.pose(self.state.angle[0]), _GENTLE)
            self._enter(StitchPhase.ALIGN)

    def _require_reach(self, stitch: Stitch) -> None:
        """Raise MotionError if the joints cannot drive the needle with its present lie in the jaw."""
        params, hand = self.params, self.driver
        way = driving_poses(stitch, params.emerge, params.lift, stitch.entry - BEFORE)
        if problem := best_reach(hand.chain, hand.base, np.array(way) @ self.state.grip).failure_reason:
            raise MotionError(f"the needle has turned in the jaw of {hand.arm}, whose {problem}")

    def _align(self) -> None:
        if self.driver.has_arrived:
            self._track_angle(self.driver, self.stitch, self.state.angle[0])
            self.state.waited += self.driver.period
            aligned = self.state.deviation[0] < _ALIGNED and self.state.waited > 0.2
            if aligned or self.state.waited > _PATIENCE:
                self._enter(StitchPhase.DRIVE)

    def _drive(self) -> None:
        stitch = self.stitch
        end = stitch.exit + self.params.emerge
        angle = min(self.state.angle[0] + self.params.drive_speed * self.driver.period, end)
        self._track_angle(self.driver, stitch, angle)
        if angle == end:
            self.state.waited += self.driver.period
            if self.state.waited <= 0.3:
                return
            if self.handing.alone:
                self.driver.move_jaw(OPEN)
                self.state.free = True
                self._enter(StitchPhase.LET_GO)
            else:
                self._to_come()

    def _let_go(self) -> None:
        self.state.waited += self.driver.period
        if self.state.waited >= OPENED:
            self.driver.go(approach_pose(pose_to_matrix(self.driver.line()), BACK))
            self._enter(StitchPhase.STEP_BACK)

    def _step_back(self) -> None:
        if self._has_arrived(self.driver):
            self._to_come()

    def _to_come(self) -> None:
        self.puller.go(self._taking_pose(self.puller, BACK))
        self._enter(StitchPhase.COME)

    def _taking_pose(self, hand: RobotHand, away: float) -> Vector:
        """Return the pose, shape (7,), of a hand taking over the needle, or so far before."""
        handed = StitchPhase.PRESENT <= self.state.phase <= StitchPhase.LEAVE_BACK
        if not handed:
            grip = self.state.planned[1]
        else:
            grip = self.state.planned[0] if hand is self.driver else self.handing.between
        return approach_pose(self.state.needle @ grip, away)

    def _come(self, after: StitchPhase) -> None:
        hand = self._next_taker
        if self._has_arrived(hand, _ACCURATE):
            hand.go(self._taking_pose(hand, 0.0), _GENTLE)
            self._enter(after)

    def _take_over(self, after: StitchPhase) -> None:
        hand = self._next_taker
        if hand.has_arrived:  # the needle may still give a little
            hand.state.goal[:] = self._taking_pose(hand, 0.0)
        if self._has_arrived(hand, _ACCURATE):
            hand.move_jaw(SHUT)
            self._enter(after)

    def _hold(self, after: StitchPhase) -> None:
        hand, other = self._next_taker, self._giver
        if not self._has_arrived(hand) or self.state.waited < _PRESSED:
            return
        alone = hand is self.driver and after is StitchPhase.RELEASE
        if hand.angle <= _HELD_OPEN:
            holder = "tissue" if alone else other.arm
            raise MotionError(f"{hand.arm} has not taken hold of the needle that {holder} holds")
        if alone:
            self._learn_grasp(hand)
            self._to_pull()
        else:
            other.move_jaw(OPEN)
            self._enter(after)

    def _release(self, after: StitchPhase) -> None:
        hand, other = self._next_taker, self._giver
        self.state.waited += hand.period
        if self.state.waited < OPENED:
            return
        if hand.angle <= _HELD_OPEN:
            raise MotionError(f"{hand.arm} has lost the needle as {other.arm} let go")
        self._learn_grasp(hand)
        other.go(approach_pose(pose_to_matrix(other.line()), BACK))
        self._enter(after)

    def _leave(self) -> None:
        """Let the driver go clear, then to the resting place, and pull."""
        if self._has_arrived(self.driver):
            self._park_hand(self.driver)
            self._to_pull()

    def _to_pull(self) -> None:
        self.state.angle[0] = self.stitch.angle(self.state.needle)
        self._enter(StitchPhase.PULL)

    def _pull(self) -> None:
        if not self.driver.has_arrived:
            return
        stitch = self.stitch
        end = stitch.base_out_angle + BEYOND
        angle = min(self.state.angle[0] + _PULL_SPEED * self.puller.period, end)
        self._track_angle(self.puller, stitch, angle)
        if angle == end:
            goal = self.puller.line()
            goal[:3] += self.params.lift * self.params.phantom.pose[:3, 2]
            self.puller.go(goal)
            self._enter(StitchPhase.RAISE)

    def _present(self) -> None:
        if self._has_arrived(self._giver):
            self._next_taker.go(self._taking_pose(self._next_taker, BACK))
            self._enter(StitchPhase.COME_BACK)

    def _leave_back(self) -> None:
        """Let the giver go clear, then to its place, and hand the needle back or begin the stitch."""
        giver, taker = self._giver, self._next_taker
        if self._has_arrived(giver):
            self._park_hand(giver)
            if self.handing.left:
                self.handing.left -= 1
                self._to_present(taker)
            else:
                self._to_approach()

    def _park_hand(self, hand: RobotHand) -> None:
        """Send a hand to the resting place."""
        hand.go(self.state.park[self.hands.index(hand)])
