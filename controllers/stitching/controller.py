"""The stitching expert as a participant: measurements in, commands out."""

from __future__ import annotations

from typing import ClassVar

from controllers.stitching.looking import Looking
from controllers.stitching.params import StitchingParams
from controllers.stitching.ports import stitching_ports
from controllers.stitching.surgeon import Surgeon
from controllers.stitching.two_hands import TwoHands
from hub.participant import Inputs, Outputs, Params, Setup
from schemas.ports import Port
from schemas.ros import StringMessage

__all__ = ["Stitching"]


class Stitching(TwoHands):
    """Makes stitches: picks the needle up, drives, hands over and pulls it out."""

    params_model: ClassVar[type[Params]] = StitchingParams
    params: StitchingParams

    def __init__(self, name: str, params: StitchingParams) -> None:
        super().__init__(name, params)
        self._surgeon = Surgeon(params, *self._hands)
        self._looking = Looking(self._hands, self._sights, params.phantom.pose)
        self.publish(self._surgeon, self._looking.state)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Measured tips and jaws and the needle's pose and holder in; commands and progress out."""
        return stitching_ports(self._hands, self._needle)

    @property
    def ended(self) -> str:
        """Ends the session once all stitches are made, or a stitch has failed."""
        state = self._surgeon.state
        if not self.params.end:
            return ""
        if state.failed[0]:
            return f"a stitch has failed: {self._surgeon.failure}"
        return "all stitches are made" if state.done[0] else ""

    def configure(self, setup: Setup) -> Outputs:
        """Start with idle hands."""
        outputs = super().configure(setup)
        if self._looks:
            self._surgeon.looking = self._looking
        return outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read the measurements, advance the procedure, and send the commands.

        Raises SessionError if a command is refused.
        """
        self._sense(self._surgeon, inputs)
        if t == 0:
            for hand in self._hands:
                hand.stay()
        surgeon = self._surgeon
        surgeon.step()
        for hand, settles in zip(self._hands, surgeon.settles, strict=True):
            rests = surgeon.looks_at_hands and hand.has_arrived
            self._outputs[f"{hand.arm}/servo_cp"] = () if rests else (hand.advance(settle=settles),)
            self._outputs[f"{hand.arm}/jaw/move_jp"] = hand.jaw_commands()
        self._shown.phase[0], self._shown.stitch[0] = surgeon.state.phase, surgeon.state.stitch
        self._outputs["status"] = tuple(StringMessage(data=text) for text in surgeon.statuses())
        return self._outputs
