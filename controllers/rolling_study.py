"""The study of stitches (`robots.dvrk.stitch_study`) as a participant, so that a scenario that rolls a needle
says in its summary what that is good for.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from hub.participant import Inputs, Outputs, Params, Setup, Stepped, state_hash
from robots.dvrk.stitch_study import study
from schemas.errors import StateError
from schemas.ports import Port

__all__ = ["RollingStudy", "RollingStudyParams"]


class RollingStudyParams(Params):
    """None: the stitches are those of `trocar study rolling`."""


class RollingStudy(Stepped):
    """Makes the study before time 0 and outputs its shares, which stay."""

    params_model: ClassVar[type[Params]] = RollingStudyParams

    def __init__(self, name: str, params: RollingStudyParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._outputs: dict[str, Any] = {name: np.zeros(1) for name in _MEANINGS}

    @property
    def ports(self) -> tuple[Port, ...]:
        """The shares."""
        return tuple(
            Port(name=name, causality="output", type="std_msgs/msg/Float64", description=meaning)
            for name, meaning in _MEANINGS.items()
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Make the study."""
        for name, share in study().shares().items():
            self._outputs[name][:] = share
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Let things be as they are."""
        return self._outputs

    def state_hash(self) -> int:
        """Return the hash of the shares."""
        return state_hash(*self._outputs.values())

    def save(self) -> bytes:
        """Return nothing: what there is follows from the study alone."""
        return b""

    def restore(self, state: bytes) -> None:
        """Take nothing. Raises StateError if it is something."""
        if state:
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes, a study has none; was it"
                " saved elsewhere?"
            )

    def close(self) -> None:
        """Nothing to give back."""


_MEANINGS = {
    "feasible_share": "share of the stitches that a needle driver that rolls the needle can make",
    "feasible_share_without": "that one without can make with the one grasp that serves most stitches",
    "feasible_share_regrasped": "that one without can make if the needle is grasped anew for each stitch",
}
"""By port."""
