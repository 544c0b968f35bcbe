"""Two hands at a needle, as a participant: measurements and publications of all kinds of stitching."""

from __future__ import annotations

from typing import Any, cast

from controllers.expert.hand import RobotHand
from controllers.expert.ports import EVENTS
from controllers.motion.frames import base_in_world
from controllers.motion.params import PsmParams
from controllers.stitching.params import StitchParams
from controllers.stitching.procedure import Procedure
from controllers.stitching.sight import Sight
from hub.participant import Controller, Inputs, Outputs, Record, Setup, array
from robots.dvrk.parameters import ArmName
from schemas.errors import SessionError
from schemas.ros import PoseWithCovarianceStamped, StringMessage

__all__ = ["TwoHands"]


class _Shown(Record):
    phase = array(1)
    stitch = array(1)


class TwoHands(Controller):
    """The hands, and a procedure for them."""

    def __init__(self, name: str, params: StitchParams) -> None:
        super().__init__(name, params)
        self._hands = (self._hand(params, params.driver), self._hand(params, params.puller))
        self._needle, self._shown = params.needle[0], _Shown()
        self._sights = tuple(Sight(hand.chain, hand.base) for hand in self._hands)
        self._looks = False
        """Whether a tracker reports the tips."""
        self._outputs: dict[str, Any] = {
            "phase": self._shown.phase,
            "stitch": self._shown.stitch,
            "status": (),
        }

    def publish(self, surgeon: Procedure, *more: Record) -> None:
        """Store the state of a procedure, and `more`; publish the procedure's outputs."""
        state = surgeon.state
        self._outputs |= {each: state.part(each) for each in ("made", "angle", "deviation", "done", "failed")}
        kept = (*self._hands, *self._sights, surgeon.rejoin)
        self.keep(state, surgeon.handing, self._shown, *(each.state for each in kept), *more)

    def _hand(self, params: StitchParams, arm: ArmName) -> RobotHand:
        held = cast("PsmParams", params.arms.present_arms[arm])
        if held.tool.jaw is None:
            raise SessionError(f"stitching '{self.name}': {arm} holds {held.tool.name}, which has no jaw")
        return RobotHand(arm, base_in_world(arm, params), held.chain, held.tool.jaw)

    def configure(self, setup: Setup) -> Outputs:
        """Start with idle hands."""
        seen = {f"{hand.arm}/seen" for hand in self._hands} & setup.connected
        if len(seen) == 1:
            raise SessionError(f"stitching '{self.name}': of its hands only {seen.pop()} is connected")
        if seen:
            self._looks = True
        for hand in self._hands:
            hand.period = setup.period_ns * 1e-9
            self._outputs |= {f"{hand.arm}/servo_cp": (), f"{hand.arm}/jaw/move_jp": ()}
        return self._outputs

    def _sense(self, surgeon: Procedure, inputs: Inputs) -> bool:
        """Read the measurements and sightings; return whether the places of the tips are known."""
        for hand, sight in zip(self._hands, self._sights, strict=True):
            arm = hand.arm
            self._refuse(arm, surgeon, inputs)
            q = inputs[f"{arm}/measured_js"][: len(hand.chain.joints)]
            hand.roll = float(q[3])
            if self._looks:
                seen = cast("tuple[PoseWithCovarianceStamped, ...]", inputs.events(f"{arm}/seen"))
                hand.stand(sight.observe_tip(q, seen, hand.period))
            jaw = float(inputs[f"{arm}/jaw/measured_js"][0])
            hand.sense(inputs[f"{arm}/local/measured_cp"], jaw)
        needle = f"objects/{self._needle}"
        surgeon.sense(inputs[f"{needle}/pose"], float(inputs[f"{needle}/held_by"][0]))
        return not self._looks or all(sight.is_known for sight in self._sights)

    def _refuse(self, arm: str, surgeon: Procedure, inputs: Inputs) -> None:
        for event in EVENTS:
            for message in inputs.events(f"{arm}/{event}"):
                phase, text = surgeon.state.phase.name.lower(), cast("StringMessage", message).data
                raise SessionError(f"stitching '{self.name}', {arm} in phase '{phase}': {text}")
