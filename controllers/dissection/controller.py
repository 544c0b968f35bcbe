"""The dissection routine as a participant: measurements and sight in, commands of two hands and power out."""

from __future__ import annotations

from typing import Any, ClassVar, cast

import numpy as np

from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.dissection.dissector import Dissector
from controllers.dissection.hook_hand import HookHand
from controllers.dissection.lifting import DissectionState
from controllers.dissection.params import DissectionParams
from controllers.dissection.ports import PROGRESS, dissection_ports
from controllers.dissection.sight import Sight
from controllers.expert.ports import EVENTS
from controllers.motion.frames import base_in_world
from controllers.motion.params import PsmParams
from hub.participant import Controller, Inputs, Outputs, Params, Setup
from robots.dvrk.end_effectors.electrode import Electrode
from schemas.errors import SessionError
from schemas.ports import Port
from schemas.ros import StringMessage

__all__ = ["Dissection"]


class Dissection(Controller):
    """Lifts the gallbladder, and frees it from the liver with the hook."""

    params_model: ClassVar[type[Params]] = DissectionParams
    params: DissectionParams

    def __init__(self, name: str, params: DissectionParams) -> None:
        super().__init__(name, params)
        self._hook, self._grasper = self._hook_hand(), self._grasping_hand()
        self._dissector = Dissector(params, self._hook, self._grasper)
        state, self._power = self._dissector.state, np.zeros(1)
        self.keep(state, self._hook.state, self._grasper.state, self._power)
        self._outputs: dict[str, Any] = {name: state.part(name) for name in PROGRESS}
        self._outputs[f"{params.hook}/energy"] = self._power

    def _hook_hand(self) -> HookHand:
        arm = self.params.hook
        held = cast("PsmParams", self.params.arms.present_arms[arm])
        electrode = cast("Electrode", held.end_effector)
        return HookHand(arm, base_in_world(arm, self.params), held.chain, electrode, held.tool.tip)

    def _grasping_hand(self) -> SurgeonHand:
        arm = self.params.grasper
        held = cast("PsmParams", self.params.arms.present_arms[arm])
        if held.tool.jaw is None:
            raise SessionError(f"dissection '{self.name}': {arm} holds {held.tool.name}, which has no jaw")
        return SurgeonHand(arm, base_in_world(arm, self.params), held.chain, held.tool.jaw)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Measured arms, what is tied, nodes of the organs in; commands, power and progress out."""
        return tuple(dissection_ports(self.params, self._hook, self._grasper))

    @property
    def state(self) -> DissectionState:
        """State of the routine."""
        return self._dissector.state

    @property
    def grasper(self) -> SurgeonHand:
        """The hand that holds the gallbladder."""
        return self._grasper

    @property
    def ended(self) -> str:
        """Reason to end the session: all is free, or the routine has given up."""
        state = self._dissector.state
        if not self.params.end:
            return ""
        if state.done:
            part, plate = self.params.part, self.params.plate
            return f"{plate} is free ({part}), after {state.recoveries} recoveries"
        return self._dissector.failure if state.failed else ""

    def configure(self, setup: Setup) -> Outputs:
        """Start with resting hands."""
        for hand in (self._hook, self._grasper):
            hand.period = setup.period_ns * 1e-9
            self._outputs[f"{hand.arm}/servo_cp"] = ()
        self._outputs |= {"status": (), f"{self._grasper.arm}/jaw/move_jp": ()}
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read the measurements, advance the routine, and send the commands."""
        dissector, outputs = self._dissector, self._outputs
        self.sense(inputs)
        if t == 0:
            dissector.begin()
        dissector.step(Sight(self.params, inputs))
        for hand in (self._hook, self._grasper):
            outputs[f"{hand.arm}/servo_cp"] = (hand.advance(settle=dissector.settles(hand)),)
        outputs[f"{self._grasper.arm}/jaw/move_jp"] = self._grasper.jaw_commands()
        self._power[0] = dissector.power
        outputs["status"] = tuple(StringMessage(data=text) for text in dissector.statuses())
        return outputs

    def sense(self, inputs: Inputs) -> None:
        """Read the measurements of the hands."""
        grasper = self._grasper
        for hand in (self._hook, grasper):
            angle = float(inputs[f"{hand.arm}/jaw/measured_js"][0]) if hand is grasper else 0.0
            hand.sense(inputs[f"{hand.arm}/local/measured_cp"], angle)
            hand.joints[:] = inputs[f"{hand.arm}/measured_js"][: len(hand.joints)]
            for event in EVENTS:
                for message in inputs.events(f"{hand.arm}/{event}"):
                    self._dissector.refuse(f"{hand.arm}: {cast('StringMessage', message).data}")
