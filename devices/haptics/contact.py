"""Contact models for a haptic loop: planes as plain floats, checked once on arrival."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

from devices.vendor_axes import Vector3

if TYPE_CHECKING:  # a servo process does without pydantic
    from schemas.trocar_msgs import ContactModel

__all__ = ["ZERO", "Plane", "check_planes", "planes_of"]

ZERO: Vector3 = (0.0, 0.0, 0.0)

_MOST_PLANES = 4
_UNIT_TOLERANCE = 1e-3
"""Tolerance of a normal's length of 1: wide enough for rounding, too narrow for any other vector."""


class Plane(NamedTuple):
    """A `trocar_msgs/ContactPlane` in the device's base frame: m, m/s, N/m, N s/m."""

    nx: float
    ny: float
    nz: float
    distance: float
    velocity: float
    stiffness: float
    damping: float
    friction: float


def planes_of(model: ContactModel) -> tuple[Plane, ...]:
    """Return the planes of a message."""
    return tuple(
        Plane(p.normal.x, p.normal.y, p.normal.z, p.distance, p.velocity, p.stiffness, p.damping, p.friction)
        for p in model.planes
    )


def check_planes(planes: Sequence[Plane]) -> tuple[Plane, ...] | None:
    """Return `planes` with normals of length 1, or None if invalid.

    Invalid are more than four planes, a number not finite, a negative coefficient, a normal without a
    direction.
    """
    if len(planes) > _MOST_PLANES:
        return None
    found: list[Plane] = []
    for plane in planes:
        nx, ny, nz, _, _, stiffness, damping, friction = plane
        if not all(map(isfinite, plane)) or min(stiffness, damping, friction) < 0.0:
            return None
        length = sqrt(nx * nx + ny * ny + nz * nz)
        if not abs(length - 1.0) < _UNIT_TOLERANCE:
            return None
        found.append(plane._replace(nx=nx / length, ny=ny / length, nz=nz / length))
    return tuple(found)
