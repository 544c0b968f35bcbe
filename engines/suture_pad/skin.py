"""The skin for drawing: a level slab, displaced around a pulling needle.

The skin has no mechanics (see `channel`). A node near displaced tissue follows the displacement of the
nearest points, the less the farther away. SI units, frame `pad`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["Skin"]

_FINE, _COARSE = 1.0e-3, 8.0e-3
"""Node spacing near stitches and elsewhere, m."""
_REACH = 5.0e-3
"""Distance for a following of 1/e of a point's displacement, m. By eye; an elastic half space under a point
load sinks with the inverse of the distance.
"""
_BLEND = 0.5e-3
"""Extra distance, beyond the nearest displaced point, for a weight of 1/e, m."""
_MARGIN = 15.0e-3
"""Margin of the fine part beyond the outermost holes, m."""


class Skin:
    """A slab with the top at z = 0."""

    def __init__(self, size: tuple[float, float, float], holes: Vector) -> None:
        """`size`: along x, y and z, m; `holes`: places of the holes, m, shape (n, 3)."""
        xs, ys = (_lines(size[axis] / 2.0, holes[:, axis]) for axis in (0, 1))
        columns, rows = len(xs), len(ys)
        self._xs, self._ys = xs, ys
        top = np.stack([*np.meshgrid(xs, ys), np.zeros((rows, columns))], axis=-1).reshape(-1, 3)
        self._count = len(top)
        bottom = top - [0.0, 0.0, size[2]]
        rim = _rim(rows, columns)
        self.rest = np.concatenate([top, bottom[rim]])
        """Nodes at rest, m, shape (n, 3): the top, row by row, then the rim at the bottom."""
        self.triangles = _triangles(rows, columns, rim)
        """Indices of nodes, counter-clockwise from outside, shape (f, 3)."""

    def displaced(self, places: Vector, displacements: Vector) -> Vector:
        """Return the nodes (m), shape (n, 3), while tissue at `places` has `displacements`, both (m, 3)."""
        nodes = self.rest.copy()
        if len(places):
            top = nodes[: self._count]
            distances = self._node_distances(places)
            nearest = distances.min(axis=1, keepdims=True)
            shares = np.subtract(nearest, distances, out=distances)
            shares /= _BLEND
            np.exp(shares, out=shares)
            shares /= shares.sum(axis=1, keepdims=True)
            top += np.exp(-nearest / _REACH) * (shares @ displacements)
        return nodes

    def _node_distances(self, places: Vector) -> Vector:
        """Return how far the top's nodes at rest, a grid, are from `places`, (m, 3): m, shape (n, m)."""
        x, y = self._xs[:, None] - places[:, 0], self._ys[:, None] - places[:, 1]
        squares = (x * x)[None] + (y * y)[:, None]  # (rows, columns, m)
        squares += places[:, 2] * places[:, 2]
        return np.sqrt(squares, out=squares).reshape(-1, len(places))


def _lines(half: float, holes: Vector) -> Vector:
    """Return the lines of the grid along an axis, m: fine around the holes."""
    low, high = max(-half, holes.min() - _MARGIN), min(half, holes.max() + _MARGIN)
    parts = [
        np.linspace(start, end, max(1, round((end - start) / step)), endpoint=False)
        for start, end, step in ((-half, low, _COARSE), (low, high, _FINE), (high, half, _COARSE))
        if end > start
    ]
    return np.concatenate([*parts, [half]])


def _rim(rows: int, columns: int) -> NDArray[np.int64]:
    """Return the nodes around the top, counter-clockwise from above."""
    grid = np.arange(rows * columns).reshape(rows, columns)
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


def _triangles(rows: int, columns: int, rim: NDArray[np.int64]) -> NDArray[np.uint32]:
    """Return the triangles of the top and of the sides; the bottom is on the base, and open."""
    grid = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (corner.ravel() for corner in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]))
    below = rows * columns + np.arange(len(rim))
    after, below_after = np.roll(rim, -1), np.roll(below, -1)
    faces = [(a, b, c), (a, c, d), (rim, below, below_after), (rim, below_after, after)]
    return np.concatenate([np.stack(face, axis=1) for face in faces]).astype(np.uint32)
