"""A phantom that moves behind the needle, as in the authors' scene: seen by the endoscope, felt by nothing.

Source: unina-icaros/dvrk-vrep (commit 88fe597), dVRK-needletracking.ttt: 2 sin, 2 cos and 5 cos mm along x, y
and z, 0.1 sin rad in each of three Euler angles, one turn of the phase in 197 steps of 5 ms.
"""

from __future__ import annotations

from itertools import product
from typing import ClassVar

import numpy as np
from pydantic import Field

from hub.participant import Controller, Inputs, Outputs, Params, Record, Setup, integer, signal_out
from robots import rotation
from schemas.ports import Port
from schemas.quantity import Duration, Length
from schemas.ros import Header, Time
from schemas.trocar_msgs import SoftBodyState

__all__ = ["SwayingPhantom", "SwayingPhantomParams"]

_SKIN = (0.160, 0.1195, 0.0237)
"""Size of the skin, m (same source)."""
_SWAY, _TURN = np.array([2e-3, 2e-3, 5e-3]), 0.1
_TURN_NS = 985_000_000
_CORNERS = 0.5 * np.array(list(product((-1.0, 1.0), repeat=3))) * _SKIN
_FACES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], np.uint32
)
"""Faces of the box, counter-clockwise from outside."""
_TRIANGLES = np.concatenate([_FACES[:, [0, 1, 2]], _FACES[:, [0, 2, 3]]]).reshape(-1)


class SwayingPhantomParams(Params):
    """Where it is, and how much it moves."""

    open_to_pages: ClassVar[bool] = True

    position: tuple[Length, Length, Length] = Field(description="of its middle in the world, on average")
    turn: Duration = Field(default=_TURN_NS, gt=0, description="time in which it sways once")
    scale: float = Field(default=1.0, ge=0.0, description="of the authors' motion")


class SwayingPhantomState(Record):
    """How long it has swayed."""

    time_ns = integer()


class SwayingPhantom(Controller):
    """A box whose nodes an endoscope draws: connect `nodes` with the endoscope's, and name it in `skins`."""

    params_model: ClassVar[type[Params]] = SwayingPhantomParams
    params: SwayingPhantomParams

    def __init__(self, name: str, params: SwayingPhantomParams) -> None:
        super().__init__(name, params)
        self._now = SwayingPhantomState()
        self.keep(self._now)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Its surface."""
        return (signal_out("nodes", SoftBodyState, frame="world"),)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start where it is at time 0, with the triangles of its surface."""
        return {"nodes": self._state(0, _TRIANGLES)}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Sway on."""
        self._now.time_ns = t + h
        return {"nodes": self._state(t + h, np.zeros(0, np.uint32))}

    def _state(self, t: int, triangles: np.ndarray) -> SoftBodyState:
        phase = 2.0 * np.pi * (t % self.params.turn) / self.params.turn
        sine, cosine = np.sin(phase), np.cos(phase)
        turn = np.eye(3)
        for axis in np.eye(3):
            turn = turn @ rotation.matrix(rotation.exp(self.params.scale * _TURN * sine * axis))
        middle = self.params.position + self.params.scale * _SWAY * (sine, cosine, cosine)
        nodes = (_CORNERS @ turn.T + middle).astype(np.float32)
        header = Header(stamp=Time.from_ns(t), frame_id="world")
        return SoftBodyState(header=header, body=self.name, nodes_m=nodes.reshape(-1), triangles=triangles)
