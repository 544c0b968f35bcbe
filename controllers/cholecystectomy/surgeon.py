"""Clip-and-cut without a person: the next sub-task by what is seen, and recovery after a loss."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controllers.cholecystectomy.approach import withdraw
from controllers.cholecystectomy.dividing import BEFORE_TUBE
from controllers.cholecystectomy.grasping import BEFORE_GRASP
from controllers.cholecystectomy.next_job import NextJob
from controllers.cholecystectomy.params import ClipAndCutParams
from controllers.cholecystectomy.procedure import GENTLE, GRASP, OPENING_TIME, SurgeonHands, nearest_clip
from controllers.cholecystectomy.sight import Sight
from controllers.cholecystectomy.sub_task import Failure, Step, SubTask, sub_task_of
from schemas.errors import MotionError
from schemas.trocar_msgs import TissueEvent

__all__ = ["Surgeon"]

_ACCURATE = 0.4e-3
"""Accuracy of a tip at the tissue, m."""
_WAITS = 1.0
"""Patience for this accuracy, s."""
_LEAKS, _STOPS = ("bleeding", "leaking"), ("bleeding stopped", "leaking stopped")
"""Kinds of events where a tube begins to leak, and where this ends."""
_SAME = 1.5e-3
"""Distance from a noted clip within which a lost clip is this one, m."""
_STRUCK = 5.0e-3
"""Error of a tip after a collision, m."""


class Surgeon(NextJob):
    """Grasps the gallbladder, and clips and cuts both tubes."""

    def __init__(self, params: ClipAndCutParams, hands: SurgeonHands) -> None:
        super().__init__(params, hands)
        self._steps: dict[Step, Callable[[], None]] = {
            Step.PLAN: self._plan,
            Step.HOVER: self._hover,
            Step.REACH: self._reach,
            Step.CLOSE: self._close,
            Step.CHECK: self.check_tube,
            Step.OPEN: self._open,
            Step.LEAVE: self._leave,
            Step.REST: self._rest,
            Step.RELOAD: self._reload,
            Step.RETRACT: self.retract,
        }

    @property
    def settles(self) -> bool:
        """Whether the measured error of the hand at work is corrected at the end of a line."""
        return self.state.step in (Step.HOVER, Step.REACH)

    def begin(self) -> None:
        """Take the present poses as the resting ones."""
        for index, hand in enumerate(self.hands):
            hand.stay()
            self.state.rests[index] = hand.measured

    def step(self, sight: Sight) -> None:
        """Advance the routine by a period."""
        self.sight, self.fires = sight, False
        state = self.state
        if state.done or state.failed or not sight.is_complete:
            return
        self._watch()
        before = state.step
        try:
            self._steps[before]()
        except MotionError as error:
            self.fail(Failure.OUT_OF_REACH, str(error))
        if state.step is before:
            state.elapsed += self.hand.period
        state.spent += self.hand.period
        if state.spent > 1e-9 * self.params.patience and not state.failed:
            self.fail(state.reason or Failure.BLOCKED, f"no success in {state.spent:.0f} s")

    def refuse(self, text: str) -> None:
        """Give up after the refusal of a command."""
        if not (self.state.failed or self.state.done):
            self.fail(Failure.REFUSED, text)

    def _watch(self) -> None:
        """Note what has happened to tubes and grasp."""
        state, seen = self.state, self.seen
        for tube in range(len(self.params.tubes)):
            for event in seen.events(tube):
                self._note(tube, event)
            if not state.parted[tube] and seen.tube(tube).is_parted:
                state.parted[tube], state.cuts, state.taut = 1.0, state.cuts + 1, False
                self.say(f"{self.params.tubes[tube]} is parted")
        if state.grasped and not seen.is_held:
            state.grasped = False
            self._lose(Failure.GRASP_SLIPPED, "the gallbladder has slipped out of the grasper")

    def _note(self, tube: int, event: TissueEvent) -> None:
        state = self.state
        at = np.array([event.position.x, event.position.y, event.position.z])
        along = self.seen.tube(tube).nearest(at)
        if event.kind == "clipped" and event.instrument == self.params.applier:
            if tube == state.tube:
                self._keep(along)
            else:
                state.slipped = True
                self.say(f"the clip is on {self.params.tubes[tube]}")
        elif event.kind in ("clip slipped", "clip not across") and event.instrument == self.params.applier:
            state.slipped = True
        elif event.kind == "clip pulled off":
            self._drop(tube, along, event.size)
        elif event.kind in _LEAKS:
            state.leaks[tube] = along
        elif event.kind in _STOPS:
            state.leaks[tube] = -1.0

    def _keep(self, along: float) -> None:
        """Note where a clip lies."""
        state = self.state
        if state.aim < 0.0:
            state.clip_places[state.tube, state.job] = along
        else:
            further = state.further[state.tube]
            further[int(further.argmin())] = along
        state.clips += 1
        state.succeeded = True

    def _drop(self, tube: int, along: float, force: float) -> None:
        """Strike off the clip that was pulled off at a place (m), at a force (N)."""
        state = self.state
        for name, places in (("clip", state.clip_places[tube]), ("further clip", state.further[tube])):
            clip = nearest_clip(places, along)
            if clip is not None and abs(float(places[clip]) - along) < _SAME:
                places[clip] = -1.0
                state.clips -= 1
                where = f"{name} {clip + 1} has come off {self.params.tubes[tube]}"
                self._lose(Failure.CLIP_LOST, f"{where} at {force:.1f} N")
                return

    def _lose(self, failure: Failure, why: str) -> None:
        """Count a loss; its sub-task is planned again, or there have been too many."""
        state = self.state
        state.slips += 1
        state.recoveries += 1
        if state.slips > self.params.attempts:
            self.fail(failure, f"{why}, loss {state.slips}")
        else:
            self.say(f"{why}; it is done again")

    def _plan(self) -> None:
        """Begin the next attempt at the first sub-task that is not done."""
        state = self.state
        if state.clips == 0 and not state.parted.any():
            state.second_first = self.seen.tube(1).hides(self.seen.tube(0), self.hands.applier.base[:3, 3])
        job_next = self.next_job()
        if job_next is None:
            self._end()
            return
        tube, job, state.aim = job_next
        if tube != state.tube:
            state.pulls = 0
        task = SubTask.GRASP_GALLBLADDER if tube == GRASP else sub_task_of(self.order.index(tube), job)
        if task is not state.sub_task:
            state.sub_task, state.tube, state.job = task, tube, job
            state.attempts, state.spent, state.reason = 0, 0.0, Failure.NONE
            self.say(self.describe())
        if tube == GRASP:
            self.aim_grasp()
        elif not state.taut and not state.parted[tube]:
            self.enter(Step.RETRACT)
        else:
            self.aim_at_tube()

    def _end(self) -> None:
        """Finish, or give up with a stump that is not closed."""
        for tube, name in enumerate(self.params.tubes):
            if self.open_side(tube) is not None:
                stays = len(self.closed(tube))
                self.fail(Failure.OPEN, f"{name} has {stays} clips, and no room for a further one")
                return
        self.state.done, self.state.sub_task = True, SubTask.DONE

    @property
    def _away(self) -> float:
        return BEFORE_GRASP if self.state.tube == GRASP else BEFORE_TUBE

    def _hover(self) -> None:
        hand, state = self.hand, self.state
        if not hand.has_arrived or (hand.error > _ACCURATE and state.elapsed < hand.state.duration + _WAITS):
            return
        if state.tube != GRASP and not (state.grasped or state.parted[state.tube]):
            self._turn_back()
        elif state.tube == GRASP or self.aim_again():
            hand.go(state.goal, GENTLE)
            self.enter(Step.REACH)

    def _turn_back(self) -> None:
        """Leave before the tissue has been touched: something else comes first."""
        self.state.succeeded = True
        self.hand.go(self._resting_pose)
        self.enter(Step.REST)

    def _reach(self) -> None:
        hand, state = self.hand, self.state
        if not hand.has_arrived or (hand.error > _ACCURATE and state.elapsed < hand.state.duration + _WAITS):
            return
        if hand.error > _STRUCK:
            self.retry(Failure.BLOCKED, f"{hand.arm} is {1e3 * hand.error:.0f} mm off its way")
        else:
            self.enter(Step.CLOSE)

    def _close(self) -> None:
        if self.state.tube == GRASP:
            self.close_on_gallbladder()
        else:
            self.close_on_tube()

    def _open(self) -> None:
        state, hand = self.state, self.hand
        if state.elapsed < OPENING_TIME:
            return
        if state.succeeded:
            state.sub_task = SubTask(state.sub_task + 1)
        hand.state.correction[:] = 0.0
        hand.go(withdraw(state.goal, self._away), 2.0 * GENTLE)
        self.enter(Step.LEAVE)

    def _leave(self) -> None:
        if not self.hand.has_arrived:
            return
        if self.state.succeeded:
            self.hand.go(self._resting_pose)
            self.enter(Step.REST)
        else:
            self.enter(Step.PLAN)

    @property
    def _resting_pose(self) -> np.ndarray:
        return self.state.rests[self.hands.index(self.hand)]

    def _rest(self) -> None:
        if self.hand.has_arrived:
            self.enter(Step.RELOAD)

    def _reload(self) -> None:
        if self.cuts or self.state.elapsed >= 1e-9 * self.params.reload:
            self.enter(Step.PLAN)
