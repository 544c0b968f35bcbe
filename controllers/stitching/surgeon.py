"""Stitches in a row, without a person: looked for, planned, counted, gone on with after a loss. SI units."""

from __future__ import annotations

from controllers.expert.hand import RobotHand
from controllers.stitching.geometry import Stitch
from controllers.stitching.handing import Handing
from controllers.stitching.looking import Looking
from controllers.stitching.params import StitchingParams
from controllers.stitching.phase import StitchPhase
from controllers.stitching.plan import make_plan, make_stitch
from controllers.stitching.procedure import ATTEMPTS, HOVER, Procedure
from controllers.stitching.rejoin import OPEN
from controllers.stitching.way_on import WayOn, is_inside
from schemas.errors import MotionError

__all__ = ["Surgeon"]


class Surgeon(Procedure):
    """Two hands, a needle, and pairs of holes."""

    def __init__(self, params: StitchingParams, driver: RobotHand, puller: RobotHand) -> None:
        super().__init__(params, driver, puller)
        self._row = params
        self.state.stitch = params.first
        self.looking: Looking | None = None
        """How the tips are shown to the tracker before a stitch; None: there is no tracker."""
        self.failure = ""
        """Why a stitch has failed; empty: none has."""

    @property
    def stitch(self) -> Stitch:
        """The stitch at work. Raises MotionError if the stitch is not feasible."""
        phantom = self.params.phantom
        return make_stitch(phantom.measures, phantom.pose, self.state.stitch, self._needle)

    @property
    def looks_at_hands(self) -> bool:
        """Whether the hands are looked at; a hand that has arrived then keeps its last command."""
        return self.looking is not None and self.state.phase is StitchPhase.BEGIN

    def _begin(self) -> None:
        if self.looking is not None and not self.looking.step():
            return
        params, state = self._row, self.state
        phantom = params.phantom
        for hand in (self.driver, self.puller):
            hand.stay()
        state.park[0], state.park[1] = self.driver.measured, self.puller.measured
        stitches = [
            make_stitch(phantom.measures, phantom.pose, params.first + i, self._needle)
            for i in range(params.stitches)
        ]
        plan = make_plan(
            self.driver,
            self.puller,
            stitches,
            state.needle,
            held=params.grip,
            taken=params.taken,
            emerge=params.emerge,
            lift=params.lift,
        )
        state.planned[0], state.planned[1] = plan.driver, plan.puller
        self._status.append(
            f"{len(stitches)} stitches are feasible, with {plan.margin:.2f} of the joints' ranges left"
        )
        for hand in (self.driver, self.puller):
            hand.move_jaw(OPEN)
        self.driver.go(self._pick_pose(HOVER))
        self._enter(StitchPhase.HOVER)

    def _way_on(self) -> WayOn:
        """Return how the stitch goes on; a needle that lies badly in a jaw is handed over and taken anew."""
        params, state = self.params, self.state
        try:
            return super()._way_on()
        except MotionError:
            if not state.holder or is_inside(params, state.needle):
                raise
            plan = Handing(
                params, self.hands, self.stitch, state.needle, self._present_hold, state.park
            ).plan()
            if plan is None:
                raise
            return plan

    def _recover(self, why: str) -> None:
        """Go on from the present place of the needle, if possible and not done too often."""
        state = self.state
        if state.phase is StitchPhase.BEGIN:
            self._fail(why)
            return
        if state.recoveries == ATTEMPTS:
            self._fail(f"{why}; given up after {ATTEMPTS} recoveries")
            return
        state.recoveries += 1
        try:
            is_out = state.phase in (StitchPhase.PULL, StitchPhase.RAISE) and not is_inside(
                self.params, state.needle
            )
            if is_out and self._made_the_last():
                return
            plan = self._way_on()
        except MotionError as error:
            self._fail(f"{why}; it cannot go on: {error}")
            return
        self._status.append(f"{why}; it is taken again")
        for hand in (self.driver, self.puller):
            hand.stay()
        self._follow(plan)

    def _fail(self, why: str) -> None:
        self.failure = why
        self._status.append(why)
        self.state.failed[0] = 1.0
        for hand in (self.driver, self.puller):
            hand.stay()
        self._enter(StitchPhase.FAILED)

    def _raise(self) -> None:
        if self._has_arrived(self.puller) and not self._made_the_last():
            stitch = self.stitch
            self._lead(self.puller, stitch.pose(stitch.exit + self.params.emerge, self.params.lift))
            self._enter(StitchPhase.PRESENT)

    def _made_the_last(self) -> bool:
        """Count a stitch, and return whether it was the last."""
        state = self.state
        state.made[0] += 1.0
        state.recoveries = 0
        if state.made[0] >= self._row.stitches:
            state.done[0] = 1.0
            self._enter(StitchPhase.DONE)
            return True
        state.stitch += 1
        return False
