"""Normals and tangents of a surface that deforms, for maps of normals that move with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["TangentFrames"]

Indices = NDArray[np.int64]

_TINY = np.finfo(np.float64).tiny


class TangentFrames:
    """The vertices of a mesh as a renderer takes them: one for each vertex and chart that meet."""

    def __init__(self, faces: Indices, charts: Indices) -> None:
        """`faces`: vertex indices, shape (m, 3); `charts`: the chart of each face, shape (m,)."""
        keys = faces * (int(charts.max()) + 1) + charts[:, None]
        _, first, corners = np.unique(keys, return_index=True, return_inverse=True)
        self._faces = faces
        self.faces: Indices = corners.reshape(-1, 3)
        """Shape (m, 3): indices of drawn vertices."""
        self.source: Indices = faces.ravel()[first]
        """The vertex of each drawn vertex, shape (n,)."""
        self.chart: Indices = charts.repeat(3)[first]
        """The chart of each drawn vertex, shape (n,)."""
        self._uv = np.zeros((len(first), 2), np.float32)
        self._weights = np.zeros((2, len(faces), 1))
        self._around_vertex = _Around(faces)
        self._around_drawn = _Around(self.faces)

    def set_uv(self, uv: NDArray[np.float32]) -> None:
        """Set the texture coordinates of the drawn vertices, shape (n, 2)."""
        self._uv = uv
        a, b, c = (uv[self.faces[:, i]].astype(np.float64) for i in range(3))
        one, two = b - a, c - a
        area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
        area = np.where(np.abs(area) < _TINY, 1.0, area)
        self._weights = np.stack([two[:, 1] / area, -one[:, 1] / area])[..., None]

    def vertices(self, points: Vector) -> NDArray[np.float32]:
        """Return position, quaternion of the tangent frame and uv, shape (n, 9), for vertices at `points`."""
        a, b, c = (points[self._faces[:, i]] for i in range(3))
        one, two = b - a, c - a
        normals = self._around_vertex.sum(np.cross(one, two))[self.source]
        tangents = self._around_drawn.sum(self._weights[0] * one + self._weights[1] * two)
        drawn = np.empty((len(self.source), 9), np.float32)
        drawn[:, :3] = points[self.source]
        drawn[:, 3:7] = _quaternions(normals, tangents)
        drawn[:, 7:] = self._uv
        return drawn


class _Around:
    """Sums of the faces around each vertex."""

    def __init__(self, faces: Indices) -> None:
        order = np.argsort(faces.ravel(), kind="stable")
        self._faces = order // 3
        self._first = np.searchsorted(faces.ravel()[order], np.arange(int(faces.max()) + 1))

    def sum(self, values: Vector) -> Vector:
        return np.add.reduceat(values[self._faces], self._first, axis=0)


def _quaternions(normals: Vector, tangents: Vector) -> Vector:
    """Return quaternions (x, y, z, w), shape (n, 4), of frames with z along normals and x near tangents.

    w is positive: the renderer takes a negative one for a mirrored frame.
    """
    z = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
    x = tangents - np.einsum("ij,ij->i", tangents, z)[:, None] * z
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), _TINY)
    y = np.cross(z, x)
    trace = x[:, 0], y[:, 1], z[:, 2]
    signs = np.array([[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0]])
    size = 0.5 * np.sqrt(np.maximum(1.0 + signs @ np.stack(trace), 0.0)).T  # (n, 4)
    size[:, 0] = np.copysign(size[:, 0], y[:, 2] - z[:, 1])
    size[:, 1] = np.copysign(size[:, 1], z[:, 0] - x[:, 2])
    size[:, 2] = np.copysign(size[:, 2], x[:, 1] - y[:, 0])
    size[:, 3] = np.maximum(size[:, 3], 1e-4)
    return size
