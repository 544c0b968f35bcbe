"""From planes to a force: a spring-damper along each normal, and dry friction across it.

Friction is a spring to an anchor on the surface (the tangential part of a god-object: Zilles and Salisbury, A
constraint-based god-object method for haptic display, 1995). The anchor stays while the spring's force is
within the friction cone, and is dragged along beyond; so a hand at rest feels a constant force, where
a law on the sign of the velocity would chatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from devices.haptics.contact import ZERO, Plane
from devices.vendor_axes import Vector3
from schemas.plain_sum import plain_sum

__all__ = ["DEAD_RECKONING", "Renderer"]

DEAD_RECKONING = 0.05
"""Longest motion of a surface with constant velocity after the arrival of a model, s."""


class Renderer:
    """Renders contact models.

    Stiffness and damping are bounded in sum: four planes in one place are no stiffer than a single plane.
    """

    def __init__(self, stiffness: float, damping: float) -> None:
        """`stiffness` (N/m) and `damping` (N s/m): the largest to be rendered."""
        self._stiffness, self._damping = stiffness, damping
        self._anchor: Vector3 | None = None

    def reset(self) -> None:
        """Discard the anchor of the friction."""
        self._anchor = None

    def force(self, planes: Sequence[Plane], age: float, position: Vector3, velocity: Vector3) -> Vector3:
        """Return the force (N) on the hand, in the base frame.

        Args:
            planes: planes of the contact model.
            age: time since the model's arrival, s.
            position: of the hand, m.
            velocity: of the hand, m/s.
        """
        x, y, z = position
        ahead = min(age, DEAD_RECKONING)
        touched: list[tuple[Plane, float]] = []
        for plane in planes:
            depth = plane[3] + plane[4] * ahead - (plane[0] * x + plane[1] * y + plane[2] * z)
            if not depth <= 0.0:  # also NaN, which the safety chain finds in the force
                touched.append((plane, depth))
        if not touched:
            self._anchor = None
            return ZERO
        return self._contact_force(touched, position, velocity, moving=age < DEAD_RECKONING)

    def _contact_force(
        self, touched: list[tuple[Plane, float]], position: Vector3, velocity: Vector3, *, moving: bool
    ) -> Vector3:
        vx, vy, vz = velocity
        stiff = _share([plane for plane, _ in touched], 5, self._stiffness)
        damp = _share([plane for plane, _ in touched], 6, self._damping)
        fx = fy = fz = 0.0
        rubbing: list[_Rubbing] = []
        for (nx, ny, nz, _, speed, k, b, mu), depth in touched:
            k, b = stiff * min(k, self._stiffness), damp * min(b, self._damping)
            leaving = nx * vx + ny * vy + nz * vz - (speed if moving else 0.0)
            push = k * depth - b * leaving
            if push <= 0.0:
                continue
            fx, fy, fz = fx + push * nx, fy + push * ny, fz + push * nz
            if mu > 0.0 and k > 0.0:
                rubbing.append((nx, ny, nz, k, b, mu * push))
        if not rubbing:
            self._anchor = None
            return fx, fy, fz
        rx, ry, rz = self._friction(rubbing, position, velocity)
        return fx + rx, fy + ry, fz + rz

    def _friction(self, rubbing: list[_Rubbing], position: Vector3, velocity: Vector3) -> Vector3:
        """Return the friction of all planes, each at most its cone's radius, towards their common anchor."""
        x, y, z = position
        way = _vector_difference(self._anchor or position, position)
        for nx, ny, nz, k, _, most in rubbing:
            across = _across(way, nx, ny, nz)
            shortened = _at_most(across, most / k)
            # what is normal to one plane is tangential to another
            along = ZERO if len(rubbing) == 1 else _vector_difference(way, across)
            way = (along[0] + shortened[0], along[1] + shortened[1], along[2] + shortened[2])
        self._anchor = (x + way[0], y + way[1], z + way[2])
        fx = fy = fz = 0.0
        for nx, ny, nz, k, b, most in rubbing:
            wx, wy, wz = _across(way, nx, ny, nz)
            vx, vy, vz = _across(velocity, nx, ny, nz)
            tx, ty, tz = _at_most((k * wx - b * vx, k * wy - b * vy, k * wz - b * vz), most)
            fx, fy, fz = fx + tx, fy + ty, fz + tz
        return fx, fy, fz


_Rubbing = tuple[float, float, float, float, float, float]
"""A plane with friction: normal, stiffness, damping, and the radius of the friction cone (N)."""


def _across(v: Vector3, nx: float, ny: float, nz: float) -> Vector3:
    """Return the part of `v` in the plane with this normal."""
    along = v[0] * nx + v[1] * ny + v[2] * nz
    return v[0] - along * nx, v[1] - along * ny, v[2] - along * nz


def _vector_difference(v: Vector3, w: Vector3) -> Vector3:
    return v[0] - w[0], v[1] - w[1], v[2] - w[2]


def _at_most(v: Vector3, most: float) -> Vector3:
    """Return `v`, shortened to length `most` if longer."""
    length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return (v[0] * most / length, v[1] * most / length, v[2] * most / length) if length > most else v


def _share(planes: list[Plane], index: int, most: float) -> float:
    """Return the factor for the coefficients number `index` that keeps their sum within `most`.

    Each coefficient is at most `most`, and the bound holds in every direction.

    The sum of c n n^T over planes has no eigenvalue above the largest row sum of sqrt(c_i c_j) |n_i . n_j|
    (Gershgorin, on the Gram matrix); a plane with friction acts in every direction, so the coefficient is
    added in full.
    """
    if len(planes) == 1:
        return 1.0
    every = plain_sum(min(p[index], most) for p in planes if p[7] > 0.0)
    smooth = [(p, sqrt(min(p[index], most))) for p in planes if p[7] <= 0.0]
    rows = (
        plain_sum(r * s * abs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) for q, s in smooth) for p, r in smooth
    )
    total = every + max(rows, default=0.0)
    return most / total if total > most else 1.0
