"""A rigid needle as three points: its frame from the points, and forces on the points for a wrench.

A bond of three points carries as much as a frame, with an exact energy book: power is the sum of forces times
velocities for any motion of the needle. SI units.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["ThreePoints"]


class ThreePoints:
    """Three points of a body, not on a line."""

    def __init__(self, marks: Vector) -> None:
        """`marks`: points in the body's frame, m, shape (3, 3)."""
        self._middle = marks.mean(axis=0)
        self._back = _axes(marks).T.copy()

    def frame(self, points: Vector) -> tuple[Vector, Vector]:
        """Return rotation, shape (3, 3), and origin (m), shape (3,), of the body with these points.

        Points slightly distorted by a prediction give the frame exact in the direction of one edge and in the
        plane.
        """
        rotation: Vector = _axes(points) @ self._back
        return rotation, points.sum(axis=0) / 3.0 - rotation @ self._middle

    @staticmethod
    def forces(points: Vector, force: Vector, moment: Vector) -> Vector:
        """Return forces (N) on `points`, shape (3, 3), equal to `force` and `moment` about 0.

        The forces have the least sum of squares.
        """
        rows, (fx, fy, fz), (mx, my, mz) = points.tolist(), force.tolist(), moment.tolist()
        cx, cy, cz = (plain_sum(axis) / 3.0 for axis in zip(*rows, strict=True))
        # the moment about the middle, and the inertia of three unit masses there
        mx, my, mz = mx - (cy * fz - cz * fy), my - (cz * fx - cx * fz), mz - (cx * fy - cy * fx)
        arms = [(x - cx, y - cy, z - cz) for x, y, z in rows]
        xx, yy, zz, xy, xz, yz = (
            plain_sum(arm[i] * arm[j] for arm in arms)
            for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        )
        turning = _solve_symmetric((yy + zz, -xy, -xz, xx + zz, -yz, xx + yy), mx, my, mz)
        u, v, w = turning
        fx, fy, fz = fx / 3.0, fy / 3.0, fz / 3.0
        return np.array([(fx + v * z - w * y, fy + w * x - u * z, fz + u * y - v * x) for x, y, z in arms])


def _solve_symmetric(
    matrix: tuple[float, float, float, float, float, float], x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the solution of a symmetric matrix, (11, 12, 13, 22, 23, 33), for the right side x, y, z."""
    a, b, c, d, e, f = matrix
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    s, t, v = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * p + b * q + c * r)
    return (
        scale * (p * x + q * y + r * z),
        scale * (q * x + s * y + t * z),
        scale * (r * x + t * y + v * z),
    )


def _axes(points: Vector) -> Vector:
    """Return a right-handed basis of a triangle as columns, shape (3, 3)."""
    (x, y, z), (a, b, c), (d, e, f) = points.tolist()
    d, e, f = d - x, e - y, f - z
    a, b, c = a - x, b - y, c - z
    scale = 1.0 / sqrt(d * d + e * e + f * f)
    d, e, f = scale * d, scale * e, scale * f
    a, b, c = e * c - f * b, f * a - d * c, d * b - e * a  # across both edges
    scale = 1.0 / sqrt(a * a + b * b + c * c)
    a, b, c = scale * a, scale * b, scale * c
    return np.array([(d, b * f - c * e, a), (e, c * d - a * f, b), (f, a * e - b * d, c)])
