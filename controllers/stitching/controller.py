"""The stitching expert as a participant: what it measures, and the commands that it sends."""

from __future__ import annotations

from typing import Any, ClassVar, cast

from controllers.expert.hand import Hand
from controllers.expert.ports import EVENTS
from controllers.motion.frames import base_in_world
from controllers.motion.params import MotionParams, PsmParams
from controllers.stitching.looking import Looking
from controllers.stitching.params import StitchingParams
from controllers.stitching.ports import stitching_ports
from controllers.stitching.sight import Sight
from controllers.stitching.surgeon import Surgeon
from hub.participant import Controller, Inputs, Outputs, Params, Record, Setup, array
from robots.dvrk.parameters import ArmName
from schemas.errors import SessionError
from schemas.ports import Port
from schemas.ros import PoseWithCovarianceStamped, StringMessage

__all__ = ["Stitching"]


class _Shown(Record):
    phase = array(1)
    stitch = array(1)


class Stitching(Controller):
    """Makes stitches: picks the needle up, drives it in, hands it over, pulls it out."""

    params_model: ClassVar[type[Params]] = StitchingParams
    params: StitchingParams

    def __init__(self, name: str, params: StitchingParams) -> None:
        super().__init__(name, params)
        self._hands = (self._hand(params.driver), self._hand(params.puller))
        self._surgeon = self._make_surgeon()
        self._needle = params.needle[0]
        state, self._shown = self._surgeon.state, _Shown()
        self._sights = tuple(Sight(hand.chain, hand.base) for hand in self._hands)
        self._looks = False
        """Whether a tracker reports the tips."""
        self._looking = Looking(self._hands, self._sights, params.phantom.pose)
        kept = (*self._hands, *self._sights, self._looking, self._surgeon.rejoin)
        self.keep(state, self._shown, *(each.state for each in kept))
        self._outputs: dict[str, Any] = {
            **{each: state.part(each) for each in ("made", "angle", "deviation", "done", "failed")},
            "phase": self._shown.phase,
            "stitch": self._shown.stitch,
            "status": (),
        }

    def _make_surgeon(self) -> Surgeon:
        return Surgeon(self.params, *self._hands)

    def _hand(self, arm: ArmName) -> Hand:
        params = self.params
        stands = MotionParams(arms=params.arms, mounting=params.mounting, setup_joints=params.setup_joints)
        held = cast("PsmParams", params.arms.driven[arm])
        if held.tool.jaw is None:
            raise SessionError(f"stitching '{self.name}': {arm} holds {held.tool.name}, which has no jaw")
        return Hand(arm, base_in_world(arm, stands), held.chain, held.tool.jaw)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Measured tips and jaws and the needle's pose and holder in; commands and progress out."""
        return stitching_ports(self._hands, self._needle)

    @property
    def ended(self) -> str:
        """Ends the session once all stitches are made, or one has failed."""
        state = self._surgeon.state
        if not self.params.end:
            return ""
        if state.failed[0]:
            return "a stitch has failed"
        return "all stitches are made" if state.done[0] else ""

    def configure(self, setup: Setup) -> Outputs:
        """Start with idle hands."""
        seen = {f"{hand.arm}/seen" for hand in self._hands} & setup.connected
        if len(seen) == 1:
            raise SessionError(f"stitching '{self.name}': of its hands only {seen.pop()} is connected")
        if seen:
            self._looks, self._surgeon.looking = True, self._looking
        for hand in self._hands:
            hand.period = setup.period_ns * 1e-9
            self._outputs |= {f"{hand.arm}/servo_cp": (), f"{hand.arm}/jaw/move_jp": ()}
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read what is measured, do what comes next, and send the commands.

        Raises SessionError if a command is refused.
        """
        self._sense(inputs)
        if t == 0:
            for hand in self._hands:
                hand.stay()
        surgeon = self._surgeon
        surgeon.step()
        for hand, settles in zip(self._hands, surgeon.settles, strict=True):
            rests = surgeon.looks and hand.has_arrived
            self._outputs[f"{hand.arm}/servo_cp"] = () if rests else (hand.advance(settle=settles),)
            self._outputs[f"{hand.arm}/jaw/move_jp"] = hand.jaw_commands()
        self._shown.phase[0], self._shown.stitch[0] = surgeon.state.phase, surgeon.state.stitch
        self._outputs["status"] = tuple(StringMessage(data=text) for text in surgeon.statuses())
        return self._outputs

    def _sense(self, inputs: Inputs) -> bool:
        """Read what is measured and seen; return whether it is known where the tips are."""
        for hand, sight in zip(self._hands, self._sights, strict=True):
            arm = hand.arm
            self._refuse(arm, inputs)
            if self._looks:
                q = inputs[f"{arm}/measured_js"][: len(hand.chain.joints)]
                seen = cast("tuple[PoseWithCovarianceStamped, ...]", inputs.events(f"{arm}/seen"))
                hand.stand(sight.see(q, seen, hand.period))
            jaw = float(inputs[f"{arm}/jaw/measured_js"][0])
            hand.sense(inputs[f"{arm}/local/measured_cp"], jaw)
        needle = f"objects/{self._needle}"
        self._surgeon.sense(inputs[f"{needle}/pose"], float(inputs[f"{needle}/held_by"][0]))
        return not self._looks or all(sight.is_known for sight in self._sights)

    def _refuse(self, arm: str, inputs: Inputs) -> None:
        for event in EVENTS:
            for message in inputs.events(f"{arm}/{event}"):
                phase, text = self._surgeon.state.phase.name.lower(), cast("StringMessage", message).data
                raise SessionError(f"stitching '{self.name}', {arm} in phase '{phase}': {text}")
