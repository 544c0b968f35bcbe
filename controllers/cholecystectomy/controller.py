"""The clip-and-cut routine as a participant: measurements and sight in, commands of three hands out."""

from __future__ import annotations

from typing import Any, ClassVar, cast

from controllers.cholecystectomy.params import ClipAndCutParams
from controllers.cholecystectomy.ports import PROGRESS, routine_ports
from controllers.cholecystectomy.procedure import SurgeonHands, SurgeonState
from controllers.cholecystectomy.sight import Sight
from controllers.cholecystectomy.sub_task import SubTask, instruction
from controllers.cholecystectomy.surfaces import Surfaces
from controllers.cholecystectomy.surgeon import Surgeon
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.expert.ports import EVENTS
from controllers.motion.frames import base_in_world
from controllers.motion.params import PsmParams
from hub.participant import Controller, Inputs, Outputs, Params, Setup, join_saved, split_saved, state_hash
from robots.dvrk.parameters import ArmName
from schemas.errors import SessionError
from schemas.ports import Port
from schemas.ros import EmptyMessage, StringMessage

__all__ = ["ClipAndCut"]


class ClipAndCut(Controller):
    """Grasps the gallbladder, then clips and cuts the cystic duct and the cystic artery."""

    params_model: ClassVar[type[Params]] = ClipAndCutParams
    params: ClipAndCutParams

    def __init__(self, name: str, params: ClipAndCutParams) -> None:
        super().__init__(name, params)
        arms = (params.applier, params.grasper, params.scissors)
        self._hands = SurgeonHands(*(self._hand(arm) for arm in arms))
        self._surgeon = Surgeon(params, self._hands)
        self._surfaces = Surfaces(dict.fromkeys((params.gallbladder, *params.avoid)))
        state = self._surgeon.state
        self.keep(state, *(hand.state for hand in self._hands))
        self._outputs: dict[str, Any] = {name: state.part(name) for name in PROGRESS}

    def _hand(self, arm: ArmName) -> SurgeonHand:
        held = cast("PsmParams", self.params.arms.present_arms[arm])
        if held.tool.jaw is None:
            raise SessionError(f"clip-and-cut '{self.name}': {arm} holds {held.tool.name}, which has no jaw")
        return SurgeonHand(arm, base_in_world(arm, self.params), held.chain, held.tool.jaw)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Measured arms, lines and events of the tubes, nodes of the organs in; commands and progress out."""
        return routine_ports(self.params, self._hands)

    @property
    def state(self) -> SurgeonState:
        """State of the routine."""
        return self._surgeon.state

    @property
    def grasper(self) -> SurgeonHand:
        """The hand that holds the gallbladder."""
        return self._hands.grasper

    @property
    def ended(self) -> str:
        """Reason to end the session: both tubes are parted, or the routine has given up."""
        state = self._surgeon.state
        if not self.params.end:
            return ""
        if state.done:
            return f"both tubes are clipped and cut, after {state.recoveries} recoveries"
        return self._surgeon.failure if state.failed else ""

    def configure(self, setup: Setup) -> Outputs:
        """Start with resting hands."""
        for hand in self._hands:
            hand.period = setup.period_ns * 1e-9
            self._outputs |= {f"{hand.arm}/servo_cp": (), f"{hand.arm}/jaw/move_jp": ()}
        self._outputs |= {"instruction": (), "status": (), f"{self.params.applier}/clip": ()}
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read the measurements, advance the routine, and send the commands."""
        surgeon, before = self._surgeon, self._surgeon.state.sub_task
        self.sense(inputs)
        if t == 0:
            surgeon.begin()
        surgeon.step(Sight(self.params, inputs, self._surfaces))
        for hand in self._hands:
            settles = surgeon.settles and hand is surgeon.hand
            self._outputs[f"{hand.arm}/servo_cp"] = (hand.advance(settle=settles),)
            self._outputs[f"{hand.arm}/jaw/move_jp"] = hand.jaw_commands()
        self._outputs[f"{self.params.applier}/clip"] = (EmptyMessage(),) if surgeon.fires else ()
        self._outputs["instruction"] = self._instruct(before)
        self._outputs["status"] = tuple(StringMessage(data=text) for text in surgeon.statuses())
        return self._outputs

    def _instruct(self, before: SubTask) -> tuple[StringMessage, ...]:
        """Return the instruction if the sub-task is another than before the step."""
        state = self._surgeon.state
        organ = self.params.tubes[max(state.tube, 0)]
        text = "" if state.sub_task is before else instruction(state.sub_task, organ)
        return (StringMessage(data=text),) if text else ()

    def state_hash(self) -> int:
        """Return the hash of the whole state."""
        return state_hash(super().save(), self._surfaces.digest)

    def save(self) -> bytes:
        """Return the bytes of the whole state."""
        return join_saved(super().save(), self._surfaces.save())

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if the state does not fit."""
        own, surfaces = split_saved(self.name, 2, state)
        self._surfaces.restore(surfaces)
        super().restore(own)

    def sense(self, inputs: Inputs) -> None:
        """Read the measurements of the hands."""
        for hand in self._hands:
            arm = hand.arm
            hand.sense(inputs[f"{arm}/local/measured_cp"], float(inputs[f"{arm}/jaw/measured_js"][0]))
            hand.joints[:] = inputs[f"{arm}/measured_js"][: len(hand.joints)]
            for event in EVENTS:
                for message in inputs.events(f"{arm}/{event}"):
                    self._surgeon.refuse(f"{arm}: {cast('StringMessage', message).data}")
