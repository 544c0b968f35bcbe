"""The study of stitches (`robots.dvrk.stitch_study`) as a participant.

A scenario that rolls a needle has in its summary what share of stitches this makes possible.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from hub.participant import Controller, Inputs, Outputs, Params, Setup, signal_out
from robots.dvrk.stitch_study import study
from schemas.ports import Port
from schemas.ros import Float64Message

__all__ = ["RollingStudy", "RollingStudyParams"]


class RollingStudyParams(Params):
    """No parameters: the stitches are those of `trocar study rolling`."""


class RollingStudy(Controller):
    """Makes the study before time 0 and outputs its shares, which are constant."""

    params_model: ClassVar[type[Params]] = RollingStudyParams

    def __init__(self, name: str, params: RollingStudyParams) -> None:
        super().__init__(name, params)
        self._outputs: dict[str, Any] = {name: np.zeros(1) for name in _MEANINGS}
        self.keep(*self._outputs.values())

    @property
    def ports(self) -> tuple[Port, ...]:
        """The shares."""
        return tuple(signal_out(name, Float64Message, meaning) for name, meaning in _MEANINGS.items())

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Make the study."""
        for name, share in study().shares().items():
            self._outputs[name][:] = share
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Return the shares."""
        return self._outputs


_MEANINGS = {
    "feasible_share": "share of the stitches that a needle driver that rolls the needle can make",
    "feasible_share_without": "share without rolling, with the one grasp that serves most stitches",
    "feasible_share_regrasped": "share without rolling, if the needle is grasped again for each stitch",
}
"""Descriptions by port."""
