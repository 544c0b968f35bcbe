"""From contact at an instrument's tip to the planes of a haptic device.

With the hand at x_h while the tip is commanded to x_t, a hand at x means the tip p(x) = x_t + s R (x - x_h).
So the plane n . p = d of the arm's base frame is, for the hand, the plane R'n . x = R'n . x_h + (d - n . x_t)
/ s: depths are divided by the scale s. A force F at the tip is c F at the hand, and so a stiffness K is s c K
there, and a damping B is s c B. Both ends of the pair (x_h, x_t) belong to the same sample of the hand, so no
delay of the sample or the planes displaces a surface at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from controllers.teleoperation.contact_estimate import ContactEstimate
from hub.participant import Params
from schemas.quantity import Damping, Length, Stiffness
from schemas.ros import Vector3
from schemas.trocar_msgs import ContactPlane
from schemas.vectors import Vector

__all__ = ["ContactModelBuilder", "ForceParams", "PlaneParams", "PlanesParams"]


def _unit_direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    length = float(np.linalg.norm(value))
    if not length > 0.0:
        raise ValueError(
            "a normal of length 0 has no direction; [0, 0, 1] points up in a base frame that stands upright"
        )
    x, y, z = value
    return x / length, y / length, z / length


class PlaneParams(Params):
    """A surface felt by the hand alone, in the arm's base frame.

    The tip is pushed to normal . tip = `distance`.
    """

    normal: Annotated[tuple[float, float, float], AfterValidator(_unit_direction)] = Field(
        description="out of the surface, of any length"
    )
    distance: Length = Field(description="of the surface from the remote centre of motion, along the normal")
    stiffness: Stiffness = Field(gt=0.0, description="force at the tip per metre of the tip")
    damping: Damping = Field(
        default=0.0, ge=0.0, description="force at the tip per speed of the tip towards the surface"
    )
    friction: float = Field(default=0.0, ge=0.0, allow_inf_nan=False, description="Coulomb's coefficient")


PlanesParams = Annotated[
    tuple[PlaneParams, ...],
    Field(max_length=2, description="surfaces that only the hand feels, in the arm's base frame"),
]
"""Planes: as many as fit a contact model beside the planes of tissue and rigid objects."""


class ForceParams(Params):
    """Fraction of the force at the tip for the hand."""

    scale: float = Field(
        default=1.0,
        ge=0.0,
        allow_inf_nan=False,
        description="newtons at the hand per newton at the tip; 0 gives no force",
    )
    max_stiffness: Stiffness = Field(
        default=400.0, gt=0.0, description="of a surface as the hand feels it; what is stiffer is felt softer"
    )
    damping: Damping = Field(
        default=1.0,
        ge=0.0,
        description="of a measured surface as the hand feels it, against what a delay builds up",
    )


class ContactModelBuilder:
    """Makes the contact model of a hand and an arm.

    The model has a plane for each surface of the scenario, for tissue and for rigid objects.
    """

    def __init__(self, force: ForceParams, planes: Sequence[PlaneParams]) -> None:
        self._force, self._planes = force, planes
        self._normals: list[Vector] = [np.array(plane.normal) for plane in planes]
        self._tissue, self._rigid = ContactEstimate(), ContactEstimate()
        self.state = (self._tissue, self._rigid)

    def planes(
        self,
        hand: Vector,
        tip: Vector,
        to_base: Vector,
        scale: float,
        *,
        following: bool,
        tip_wrench: Vector,
        rigid_wrench: Vector,
        elapsed: float,
    ) -> list[ContactPlane]:
        """Return at most four planes in the device's base frame, in metres of the hand.

        Empty while the arm does not follow.

        Args:
            hand: position (3,) of the hand in the device's base frame, m: the sample of the command.
            tip: position (3,) of the tip at the command in the arm's base frame, m.
            to_base: rotation (3, 3) from the device's base frame to the arm's.
            scale: metres of the tip per metre of the hand.
            following: whether the tip follows the hand.
            tip_wrench: force and moment (6,) of tissue on the instrument in the arm's base frame, N and N m.
            rigid_wrench: force and moment (6,) of rigid objects, likewise.
            elapsed: simulated time since the last call, s. Call also while the arm does not follow: touched
                surfaces are remembered.
        """
        self._tissue.update(tip, tip_wrench[:3], scale, elapsed)
        self._rigid.update(tip, rigid_wrench[:3], scale, elapsed)
        gain = self._force.scale * scale
        if not following or not gain:
            return []
        planes = [
            self._contact_plane(
                hand,
                to_base.T.dot(normal),
                (plane.distance - float(normal.dot(tip))) / scale,
                gain * plane.stiffness,
                gain * plane.damping,
                plane.friction,
            )
            for plane, normal in zip(self._planes, self._normals, strict=True)
        ]
        felt = (estimate for estimate in (self._tissue, self._rigid) if estimate.known)
        planes += [
            self._contact_plane(
                hand,
                to_base.T.dot(surface.normal),
                surface.depth(tip) / scale,
                gain * surface.stiffness,
                self._force.damping,
                surface.friction,
            )
            for surface in felt
        ]
        return planes

    def _contact_plane(
        self, hand: Vector, normal: Vector, depth: float, stiffness: float, damping: float, friction: float
    ) -> ContactPlane:
        """Return the plane with this `normal` (3,) and the hand `depth` below, in the hand's frame."""
        x, y, z = normal.tolist()
        return ContactPlane(
            normal=Vector3(x=x, y=y, z=z),
            distance=float(normal.dot(hand)) + depth,
            stiffness=min(stiffness, self._force.max_stiffness),
            damping=damping,
            friction=friction,
        )
