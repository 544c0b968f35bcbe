"""A rigid needle by three points of it: its frame from where they are, and forces on them for a wrench.

A bond of three points carries all that a frame can, and its energy book is exact in all of it: power is the
sum of forces times velocities, whichever way the needle turns. SI units.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from schemas.vectors import Vector

__all__ = ["ThreePoints", "cross"]

_ONE = np.eye(3)
_YZX, _ZXY = np.array([1, 2, 0]), np.array([2, 0, 1])


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross products of `a` and `b`, shape (..., 3), at a fifth of the cost of np.cross."""
    if a.ndim == b.ndim == 1:
        (u, v, w), (x, y, z) = a.tolist(), b.tolist()
        return np.array([v * z - w * y, w * x - u * z, u * y - v * x])
    return a.take(_YZX, -1) * b.take(_ZXY, -1) - a.take(_ZXY, -1) * b.take(_YZX, -1)


class ThreePoints:
    """Three points of a body that are not on one line."""

    def __init__(self, marks: Vector) -> None:
        """Take where the points are in the body's frame, m, shape (3, 3)."""
        self._middle = marks.mean(axis=0)
        self._back = _axes(marks).T.copy()

    def frame(self, points: Vector) -> tuple[Vector, Vector]:
        """Return rotation, shape (3, 3), and origin (m), shape (3,), of the body whose points are there.

        Points that a prediction has moved apart a little give the frame in which one edge is exact in
        direction, and the plane.
        """
        rotation: Vector = _axes(points) @ self._back
        return rotation, points.sum(axis=0) / 3.0 - rotation @ self._middle

    @staticmethod
    def forces(points: Vector, force: Vector, moment: Vector) -> Vector:
        """Return forces (N) on `points`, shape (3, 3), that together are `force` and `moment` about 0.

        Of all such forces they have the least sum of squares.
        """
        middle = points.sum(axis=0) / 3.0
        arms = points - middle
        about_middle = moment - cross(middle, force)
        inertia: Vector = float((arms * arms).sum()) * _ONE - arms.T @ arms
        turning: Vector = np.linalg.inv(inertia) @ about_middle
        spread: Vector = force / 3.0 + cross(turning, arms)
        return spread


def _axes(points: Vector) -> Vector:
    """Return a right-handed basis of a triangle as columns, shape (3, 3)."""
    edges = points[1:] - points[0]
    along = edges[1] / sqrt(float(edges[1] @ edges[1]))
    normal = cross(along, edges[0])
    normal = normal / sqrt(float(normal @ normal))
    basis = np.empty((3, 3))
    basis[:, 0], basis[:, 1], basis[:, 2] = along, cross(normal, along), normal
    return basis
