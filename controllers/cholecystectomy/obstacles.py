"""Bodies that instruments keep away from: triangles with a thickness. SI units, in the world.

A point is a triangle of three equal corners, a piece of a line one of two.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["Obstacles"]

_FLAT = 1e-24
"""Square of twice the area of a triangle without an inside, m^4."""


class Obstacles(NamedTuple):
    """Triangles that jaws and shafts keep away from."""

    corners: Vector
    """m, shape (n, 3, 3): triangle, corner, axis."""
    radii: Vector
    """Thickness of the body around each triangle, m, shape (n,)."""

    @staticmethod
    def points(points: Vector, radii: Vector) -> Obstacles:
        """Return spheres: `points` in m, shape (n, 3), `radii` in m, shape (n,)."""
        return Obstacles(np.repeat(points[:, None], 3, axis=1), radii)

    @staticmethod
    def line(points: Vector, radii: Vector, whole: NDArray[np.bool_] | None = None) -> Obstacles:
        """Return a line of straight pieces: `points` in m, shape (n, 3), `radii` in m, shape (n,).

        `whole`: the pieces that are there, shape (n - 1,); None: all.
        """
        chosen = slice(None) if whole is None else whole
        corners = np.stack([points[:-1], points[1:], points[1:]], axis=1)
        return Obstacles(corners[chosen], np.maximum(radii[:-1], radii[1:])[chosen])

    @staticmethod
    def join(parts: Sequence[Obstacles]) -> Obstacles:
        """Return all obstacles of several."""
        corners = [np.zeros((0, 3, 3)), *(part.corners for part in parts)]
        return Obstacles(
            np.concatenate(corners), np.concatenate([np.zeros(0), *(part.radii for part in parts)])
        )

    def near(self, point: Vector, reach: float) -> Obstacles:
        """Return the obstacles with a corner within `reach` (m) of a point (m, shape (3,))."""
        chosen = (np.linalg.norm(self.corners - point, axis=2) < reach).any(axis=1)
        return Obstacles(self.corners[chosen], self.radii[chosen])

    def distances(self, points: Vector, farthest: float) -> Vector:
        """Return the distance of each point from the nearest obstacle, at most `farthest`, m, shape (k,).

        `points`: m, shape (k, 3). Inside the thickness of an obstacle the distance is negative.
        """
        found: Vector = np.full(len(points), farthest)
        if not len(points):
            return found
        reach = farthest + self.radii[:, None]
        low, high = points.min(axis=0), points.max(axis=0)
        beside = (self.corners.max(axis=1) < low - reach) | (self.corners.min(axis=1) > high + reach)
        corners, radii = (part[~beside.any(axis=1)] for part in self)
        middles = corners.mean(axis=1)
        sizes = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1, initial=0.0)
        apart = np.linalg.norm(points[:, None] - middles, axis=2)  # (k, n)
        point, face = np.nonzero(apart - sizes - radii < farthest)
        np.minimum.at(found, point, _apart(points[point], corners[face]) - radii[face])
        return found


def _apart(points: Vector, corners: Vector) -> Vector:
    """Return the distance of each point from its triangle, m, shape (m,).

    `points`: m, shape (m, 3). `corners`: m, shape (m, 3, 3).
    """
    ways = np.roll(corners, -1, axis=1) - corners
    off = points[:, None] - corners
    squares = np.maximum((ways * ways).sum(axis=2), 1e-18)
    shares = np.clip((off * ways).sum(axis=2) / squares, 0.0, 1.0)
    edges: Vector = np.linalg.norm(off - shares[:, :, None] * ways, axis=2).min(axis=1)
    normals = np.cross(ways[:, 0], ways[:, 1])
    area = (normals * normals).sum(axis=1)
    sides = (np.cross(ways, off) * normals[:, None]).sum(axis=2)
    above: NDArray[np.bool_] = (sides >= 0.0).all(axis=1) & (area > _FLAT)
    heights: Vector = np.abs((off[:, 0] * normals).sum(axis=1)) / np.sqrt(np.maximum(area, _FLAT))
    return np.where(above, heights, edges)
