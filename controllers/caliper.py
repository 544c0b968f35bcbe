"""Measuring with a hand: two opposed fingers close on an organ, and their kinematics yield its width.

For comparison the width of the organ's mesh at rest is computed along the same line.
"""

from __future__ import annotations

from typing import Any, ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.ports import measured_joints
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    event_out,
    flag,
    number,
    signal_in,
    signal_out,
)
from robots.dvrk.end_effectors.musha import HAND
from robots.dvrk.parameters import ArmName
from schemas.errors import SessionError, StateError
from schemas.ports import Port
from schemas.quantity import Force
from schemas.ros import Float64Message, JointState
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import Vector

__all__ = ["Caliper", "CaliperParams", "width_of_mesh"]

_FINGERS, _PHALANGES = len(HAND.fingers), len(HAND.phalanges)
_SPHERES = _FINGERS * _PHALANGES
_JAWS = (0, 1)
"""The fingers opposed in the mode `caliper`."""
_OPEN, _CLOSED = HAND.command("caliper", 0.0), HAND.command("caliper", 1.0)


class CaliperParams(Params):
    """Which hand measures, how fast it closes, and when it has touched."""

    open_to_pages: ClassVar[bool] = True

    arm: ArmName
    touch: Force = Field(default=0.05, gt=0, description="force on a fingertip at which its finger stops")
    rate: float = Field(
        default=0.05,
        gt=0,
        description="at which the fingers close, in 1/s: share of the way from open to closed",
    )


class CaliperState(Record):
    """Progress of the measurement."""

    closing = array(_FINGERS)
    """State of each finger: 0 open to 1 closed."""
    touched = array(_FINGERS)
    """Flag of each finger: 1 if the tip has felt the organ."""
    started = flag()
    width = number()
    """m; 0: not yet measured."""
    true_width = number()


class Caliper(Controller):
    """Closes the two fingers from where they are once `start` is 1.

    Each stops when its tip feels the organ; when both have, the width is published.
    """

    params_model: ClassVar[type[Params]] = CaliperParams
    params: CaliperParams

    def __init__(self, name: str, params: CaliperParams) -> None:
        super().__init__(name, params)
        self._now = CaliperState()
        self._closing, self._touched = self._now.closing, self._now.touched
        self._keep_mesh(np.zeros((0, 3, 3)))
        self._command = f"{params.arm}/hand/servo_jp"
        self._outputs: dict[str, Any] = {
            self._command: (),
            "width": self._now.part("width"),
            "true_width": self._now.part("true_width"),
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """Hand and tissue in; the command to the fingers and the widths out."""
        scalar, size = Float64Message, 3 * _SPHERES
        motors, bones = tuple(joint.name for joint in HAND.joints), tuple(bone.name for bone in HAND.bones)
        at, force = "of the hand's contact spheres", "on the hand's contact spheres"
        width = "between the fingertips' surfaces when both have touched; 0 before"
        true_width = "of the mesh at rest along the line through both fingertips"
        return (
            signal_in("start", scalar, "1: measure", start=(0.0,)),
            measured_joints("hand", motors, "its measured_js"),
            measured_joints("phalanges", bones, "their measured_js"),
            signal_in("position", description=at, size=size, unit="m", frame="world"),
            signal_in("force", description=force, size=size, unit="N", frame="world"),
            signal_in("nodes", SoftBodyState, "of the organ", frame="world"),
            event_out(self._command, JointState),
            signal_out("width", scalar, width, unit="m"),
            signal_out("true_width", scalar, true_width, unit="m"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Wait for `start`."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Close the fingers that have not touched the organ.

        Raises SessionError if one is closed and has felt nothing.
        """
        self._outputs[self._command] = ()
        self._read_mesh(inputs)
        if not inputs["start"][0] or self._now.width:
            return self._outputs
        if not self._now.started:
            closings = (inputs["hand"][:_FINGERS] - _OPEN[:_FINGERS])[list(_JAWS)] / (_CLOSED - _OPEN)[
                list(_JAWS)
            ]
            self._now.started, self._closing[list(_JAWS)] = True, np.clip(closings, 0.0, 1.0)
        self._note_touches(inputs["force"].reshape(_FINGERS, _PHALANGES, 3))
        if self._touched[list(_JAWS)].all():
            self._measure(inputs)
        else:
            self._close(h * 1e-9)
        return self._outputs

    def _keep_mesh(self, mesh: Vector) -> None:
        """Keep the corners of the organ's triangles at rest, m, shape (n, 3, 3)."""
        self._mesh = mesh
        self.keep(self._now, mesh)

    def _read_mesh(self, inputs: Inputs) -> None:
        """Read the mesh at rest from the first state of the organ, which has the triangles."""
        body = cast("SoftBodyState | None", inputs.message("nodes"))
        if not len(self._mesh) and body is not None and body.triangles.size:
            self._keep_mesh(body.nodes_m.astype(np.float64).reshape(-1, 3)[body.triangles.reshape(-1, 3)])

    def _note_touches(self, forces: Vector) -> None:
        """Note which fingertips are touched; the real hand has its force sensors there."""
        for finger in _JAWS:
            if np.linalg.norm(forces[finger, -1]) >= self.params.touch:
                self._touched[finger] = 1.0

    def _close(self, seconds: float) -> None:
        for finger in _JAWS:
            if not self._touched[finger]:
                self._closing[finger] += self.params.rate * seconds
        if self._closing.max() > 1.0:
            missing = " and ".join(HAND.fingers[i] for i in _JAWS if not self._touched[i])
            raise SessionError(
                f"caliper '{self.name}': {missing} closed without feeling {self.params.touch:g} N; is the"
                " organ between the fingers?"
            )
        command = _OPEN + np.tile(self._closing, 2) * (_CLOSED - _OPEN)
        self._outputs[self._command] = (JointState(position=command),)

    def _measure(self, inputs: Inputs) -> None:
        contacts = HAND.contacts(inputs["phalanges"][:_SPHERES].reshape(_FINGERS, _PHALANGES))
        one, other = (contacts[finger, -1] for finger in _JAWS)
        self._now.width = float(np.linalg.norm(one - other)) - 2.0 * HAND.radius
        ends = inputs["position"].reshape(_FINGERS, _PHALANGES, 3)
        self._now.true_width = width_of_mesh(self._mesh, ends[_JAWS[0], -1], ends[_JAWS[1], -1])

    def restore(self, state: bytes) -> None:
        """Return to a saved state, whose mesh may be another one.

        Raises StateError, and changes nothing, if its size is wrong or a field cannot have its value.
        """
        mesh, (triangles, rest) = self._mesh, divmod(len(state) - self._now.values.nbytes, 9 * 8)
        if triangles < 0 or rest:
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes, which is not a caliper's;"
                " was it saved elsewhere?"
            )
        self._keep_mesh(np.zeros((triangles, 3, 3)))
        try:
            super().restore(state)
        except StateError:
            self._keep_mesh(mesh)
            raise


def width_of_mesh(triangles: Vector, one: Vector, other: Vector) -> float:
    """Return the width of a closed surface along the line through two points.

    It is measured between the outermost points where the line meets the surface, and 0 if it misses.
    Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", Journal of Graphics Tools 2
    (1997).

    Args:
        triangles: corners, m, shape (n, 3, 3).
        one: a point on the line, m, shape (3,).
        other: another one.
    """
    direction = (other - one) / np.linalg.norm(other - one)
    corner, u_edge, v_edge = (
        triangles[:, 0],
        triangles[:, 1] - triangles[:, 0],
        triangles[:, 2] - triangles[:, 0],
    )
    p = np.cross(direction, v_edge)
    determinant = np.einsum("ni,ni->n", u_edge, p)
    met = np.abs(determinant) > 1e-15  # m^2: else the line lies in the triangle's plane
    scale = 1.0 / np.where(met, determinant, 1.0)
    away = one - corner
    q = np.cross(away, u_edge)
    u, v = scale * np.einsum("ni,ni->n", away, p), scale * (q @ direction)
    where = (scale * np.einsum("ni,ni->n", v_edge, q))[met & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)]
    return float(where.max() - where.min()) if where.size else 0.0
