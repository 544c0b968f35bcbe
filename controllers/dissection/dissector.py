"""Frees the gallbladder from its bed: the hook burns tied places, the nearest to the free end first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controllers.cholecystectomy.approach import withdraw
from controllers.cholecystectomy.obstacles import Obstacles
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.dissection.hook_hand import HookHand
from controllers.dissection.params import DissectionParams
from controllers.dissection.sight import Sight
from controllers.dissection.step import Failure, Step
from controllers.dissection.stripping import Stripping
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Dissector"]

_BEFORE = 20.0e-3
"""Length of the straight way to a tied place, m."""
_BESIDE = 12.0e-3
"""Distance of the next place up to which the hook stays in the gap, m."""
_GENTLE, _FINE = 0.3, 0.15
"""Shares of the speed before tissue, and in the gap."""
_BESIDE_FAT = 25.0e-3
"""The same below fat, m."""
_AWAY = 0.1
"""Time with power without heat after which the hook goes deeper, s."""
_DEEPER, _DEEPEST = 0.8e-3, 5.0e-3
"""Length of a way deeper, and of all of them, m."""
_TOWARDS, _FARTHEST = 0.7, 2.0e-3
"""Share of the way from a tied place to the gallbladder's wall at which the hook works, and its limit, m."""
_PAST = 2.5e-3
"""Distance beyond which a tied place is another one, m."""
_LONG_FAT = 1.0
"""Longest time with the hook at fat that does not part, s."""
_RAISED, _TUCKED = 4.5e-3, 1.5e-3
"""Way of the hook when it lifts fat, along the normal and farther below the fat, m."""


class Dissector(Stripping):
    """Grasps and lifts the gallbladder, and burns what ties it to the liver."""

    def __init__(self, params: DissectionParams, hook: HookHand, grasper: SurgeonHand) -> None:
        super().__init__(params, hook, grasper)
        self.power = 0.0
        """Power of the generator in this step, W."""
        self._steps: dict[Step, Callable[[], None]] = {
            Step.AIM_GRASP: self._aim_grasp,
            Step.HOVER_GRASP: self.hover_grasp,
            Step.REACH_GRASP: self.reach_grasp,
            Step.CLOSE: self.close,
            Step.LIFT: self._lift,
            Step.PLAN: self._plan,
            Step.HOVER: self._hover,
            Step.REACH: self._reach,
            Step.RAISE: self._raise,
            Step.BURN: self._burn,
            Step.LEAVE: self._leave,
            Step.AIM_FOLD: self.aim_fold,
            Step.HOVER_FOLD: self.hover_fold,
            Step.REACH_FOLD: self.reach_fold,
            Step.PINCH: self.pinch,
            Step.STRIP: self.strip,
            Step.RELEASE_FOLD: self.release_fold,
        }

    def settles(self, hand: SurgeonHand) -> bool:
        """Whether the measured error of a hand is corrected at the end of its line."""
        grasps = self.state.step in (Step.HOVER_GRASP, Step.REACH_GRASP, Step.HOVER_FOLD, Step.REACH_FOLD)
        return grasps if hand is self.grasper else self.state.step in (Step.HOVER, Step.REACH, Step.BURN)

    def begin(self) -> None:
        """Take the present poses as the resting ones."""
        for index, hand in enumerate((self.hook, self.grasper)):
            hand.stay()
            self.state.rests[index] = hand.measured

    def refuse(self, text: str) -> None:
        """Give up after the refusal of a command."""
        if not (self.state.failed or self.state.done):
            self.fail(Failure.REFUSED, text)

    def step(self, sight: Sight) -> None:
        """Advance the routine by a period."""
        self.sight, self.power = sight, 0.0
        state = self.state
        if state.done or state.failed or not sight.is_complete:
            return
        state.ties = len(self.ties)
        self._watch()
        before = state.step
        try:
            self._steps[before]()
        except MotionError as error:
            self.fail(Failure.OUT_OF_REACH, str(error))
        if before > Step.LIFT:
            self.pull()
        if state.step is before:
            state.elapsed += self.hook.period

    def _watch(self) -> None:
        """Note a grasp that has been lost, and the end of the work."""
        state, seen = self.state, self.seen
        if state.grasped and not seen.is_held:
            state.grasped = False
            state.recoveries += 1
            if state.grasps >= self.params.attempts:
                self.fail(Failure.GRASP_SLIPPED, f"the gallbladder has slipped away, grasp {state.grasps}")
                return
            self.say("the gallbladder has slipped out of the grasper; it is grasped again")
            self.grasper.move_jaw(self.opening)
            self._leave_tissue(Step.AIM_GRASP)
        if state.ahead.any() and self.is_free and Step.LIFT <= state.step < Step.LEAVE:
            if state.clears:
                self.say("the fat is cleared")
                self.end_fat()
                self._leave_tissue(Step.LIFT)
            else:
                self.say("all is free")
                self._leave_tissue(Step.LEAVE)

    def _leave_tissue(self, step: Step) -> None:
        """Draw the hook back out of the gap."""
        self.hook.state.correction[:] = 0.0
        self.state.inside = False
        self.hook.go(withdraw(self.hook.line(), _BEFORE), 2.0 * _GENTLE)
        self.enter(step)

    def _aim_grasp(self) -> None:
        if not self.hook.has_arrived:
            return
        if not self.state.ahead.any():
            self.find_work()
        if self.state.clears and not self.state.stripped:
            self.enter(Step.AIM_FOLD)
        else:
            self.aim_grasp()

    def _lift(self) -> None:
        if self.hook.has_arrived and self.pull():
            way = 1e3 * self.state.pulled
            self.say(
                "the gallbladder is held"
                if self.state.clears
                else f"the gallbladder is lifted by {way:.0f} mm, {self.seen.pull:.2f} N"
            )
            self.enter(Step.PLAN)

    def _plan(self) -> None:
        """Choose the next place, and go there: within the gap, or from before it."""
        state, hook = self.state, self.hook
        if state.clears and not hook.has_arrived:
            return
        is_inside = state.inside or not state.clears
        places = self.edge_places(is_inside=is_inside)
        place = places[state.skipped % len(places)]
        if state.skipped > self.params.attempts * max(1, state.ties):
            self.fail(Failure.NOT_PARTED, f"{state.ties} places hang together")
            return
        beside = _BESIDE_FAT if state.clears else _BESIDE
        is_near = is_inside and bool(np.linalg.norm(hook.bare_end - place) < beside)
        if state.clears and state.inside and not is_near:
            self._leave_tissue(Step.PLAN)
            return
        way = 0.0 if is_near else _BEFORE
        obstacles = Obstacles.join([self.seen.obstacles, self.grasper_shaft, self.fat_body])
        try:
            state.goal[:] = hook.choose(self._beside(place), state.ahead, state.normal, way, obstacles)
        except MotionError:
            if state.skipped >= self.params.attempts * state.ties:
                raise
            state.skipped += 1
            return
        state.place[:], state.deeper, state.idle = place, 0.0, 0.0
        state.before = len(self.ties)
        hook.state.correction[:] = 0.0
        if is_near:
            hook.go(state.goal, _GENTLE if state.clears else _FINE)
            self.enter(Step.REACH)
        else:
            hook.go(withdraw(state.goal, _BEFORE))
            self.enter(Step.HOVER)

    def _beside(self, place: Vector) -> Vector:
        """Return where the hook works at a tied place, m, shape (3,): towards the gallbladder's wall."""
        if self.state.clears:
            return self.under_fat(place)
        nodes = self.seen.gallbladder
        wall = nodes[np.linalg.norm(nodes - place, axis=1).argmin()] - place
        length = float(np.linalg.norm(wall))
        found: Vector = place + min(_TOWARDS, _FARTHEST / max(length, 1e-9)) * wall
        return found

    def _hover(self) -> None:
        if self.hook.has_arrived:
            self.hook.go(self.state.goal, _GENTLE)
            self.enter(Step.REACH)

    def _reach(self) -> None:
        if not self.hook.has_arrived:
            return
        self.state.inside = True
        if self.state.clears:
            self.state.goal[:3] += _RAISED * self.state.normal + _TUCKED * self.state.ahead
            self.hook.go(self.state.goal, _FINE)
            self.enter(Step.RAISE)
        else:
            self._begin_burn()

    def _raise(self) -> None:
        """Lift the fat without power; what does not part is burnt, away from what lies below."""
        if self._has_parted():
            self._go_on()
        elif self.hook.has_arrived:
            self._begin_burn()

    def _begin_burn(self) -> None:
        self.state.heat, self.state.yielded = self.seen.delivered, False
        self.enter(Step.BURN)

    def _has_parted(self) -> bool:
        """Return whether the place at which the hook works has parted, and follow it if not."""
        state, ties = self.state, self.ties
        if state.clears:
            return len(ties) < state.before
        if not len(ties) or np.linalg.norm(ties - state.place, axis=1).min() > _PAST:
            return True
        state.place[:] = ties[np.linalg.norm(ties - state.place, axis=1).argmin()]
        return False

    def _go_on(self) -> None:
        self.state.skipped = 0
        self.enter(Step.PLAN)

    def _leave_place(self) -> None:
        """Try another place first."""
        self.state.skipped += 1
        self.state.recoveries += 1
        self.enter(Step.PLAN)

    def _burn(self) -> None:
        """Burn until the place has parted; where nothing is touched go deeper, power off."""
        state, hook = self.state, self.hook
        if self._has_parted():
            if self.is_beside_fat:
                state.before, state.elapsed, state.yielded = len(self.ties), 0.0, True
            else:
                self._go_on()
                return
        longest = _LONG_FAT if state.clears else 1e-9 * self.params.patience
        if state.elapsed > longest or not self.may_burn:
            (self._go_on if state.yielded else self._leave_place)()
            return
        if not hook.has_arrived:
            return
        heats = self.seen.delivered > state.heat
        state.heat = self.seen.delivered
        state.idle = 0.0 if heats else state.idle + hook.period
        if state.idle <= _AWAY:
            self.power = self.params.power
            return
        state.idle = 0.0
        if state.yielded:
            self._go_on()
        elif state.deeper < _DEEPEST and not state.clears:
            state.deeper += _DEEPER
            hook.go(withdraw(state.goal, -state.deeper), _FINE)
        else:
            state.elapsed = 1e-9 * self.params.patience

    def _leave(self) -> None:
        """Bring the hook to its resting place."""
        state, hook = self.state, self.hook
        if not hook.has_arrived:
            return
        if np.linalg.norm(hook.state.goal - state.rests[0]) > 0.0:
            hook.go(state.rests[0])
        else:
            state.done = True
            self.enter(Step.DONE)
