"""From the coarse triangles of a soft body to a surface that looks smooth.

Sharp edges are kept, triangles are curved. The nodes stay where they are; between them the surface follows
the cubic edge of a curved point-normal triangle (Vlachos, Peters, Boyd, Mitchell: Curved PN Triangles, I3D
2001): the middle of the edge from a to b with unit normals n and m there, and d = b - a, is (a + b)/2 - ((d .
n) n - (d . m) m)/8. It depends on the edge alone, so neighbours meet without a gap.
"""

from __future__ import annotations

from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["SkinMesh"]

Indices = NDArray[np.int64]

_CREASE = radians(80.0)
"""Faces that meet at a greater angle at rest (0: in one plane) meet at a sharp edge, as those of a box do.

The curved parts of the organs in `engines.tissue.organs`, of 150 to 3000 nodes, stay below, all but some
rims; the ends of the colon are above.
"""

_ENOUGH = 12_000
"""Triangles are divided once, and again while there are no more than these: MuJoCo takes its light at
vertices, so large triangles show.
"""


class SkinMesh:
    """The displayed surface of a soft body.

    A vertex on a sharp edge is listed once for each adjacent smooth face.
    """

    def __init__(
        self,
        rest: Vector,
        triangles: Indices,
        kinds: NDArray[np.uint8] | None = None,
        most: int | None = None,
    ) -> None:
        """Divide the surface until it looks smooth.

        Args:
            rest: the nodes at rest, shape (n, 3), m.
            triangles: of the surface, node indices, shape (f, 3), counter-clockwise from outside.
            kinds: kinds of the triangles, shape (f,); an edge between two kinds is sharp. None: one kind.
            most: largest number of divided triangles; None: any.
        """
        faces, self._node = _split_vertices(rest, triangles, kinds)
        self._divisions: list[_Division] = []
        while (not self._divisions or 4 * len(faces) <= _ENOUGH) and (most is None or 4 * len(faces) <= most):
            division = _Division(faces)
            self._divisions.append(division)
            faces = division.faces
        self.faces: Indices = faces
        """Vertex indices, shape (m, 3), counter-clockwise from outside; those of a triangle together."""

    def vertices(self, nodes: Vector) -> Vector:
        """Return the vertices, shape (v, 3), m, for `nodes`, shape (n, 3), m: those at nodes come first."""
        points = nodes[self._node]
        for division in self._divisions:
            points = division.refine(points)
        return points

    def spread(self, values: Vector) -> Vector:
        """Return values at the vertices, shape (v,), for values at the nodes, shape (n,)."""
        found = values[self._node]
        for division in self._divisions:
            found = division.spread(found)
        return found


class _Division:
    """Every triangle becomes four."""

    def __init__(self, corners: Indices) -> None:
        """Divide triangles `corners`, vertex indices, shape (f, 3)."""
        self._corners = corners
        by_vertex = np.argsort(corners.ravel(), kind="stable")
        count = int(corners.max()) + 1
        self._around = by_vertex // 3
        self._first = np.searchsorted(corners.ravel()[by_vertex], np.arange(count))
        # (3 f, 2)
        sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
        edges, edge_of, sharing = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
        self._ends = edges.T.copy()
        self._curved = (sharing == 2)[:, None] / 8.0
        a, b, c = corners.T
        ab, bc, ca = (count + edge_of.reshape(-1, 3)).T
        self.faces: Indices = np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1).reshape(-1, 3)
        """Shape (4 f, 3): the old vertices, then one for each edge."""

    def spread(self, values: Vector) -> Vector:
        """Return `values`, shape (v,), and after them those in the middles of the edges."""
        start, end = self._ends
        return np.concatenate([values, 0.5 * (values[start] + values[end])])

    def refine(self, points: Vector) -> Vector:
        """Return `points`, shape (v, 3), m, and after them the middles of the curved edges."""
        a, b, c = (points[self._corners[:, i]] for i in range(3))
        areas = np.cross(b - a, c - a)
        normals = np.add.reduceat(areas[self._around], self._first, axis=0)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        start, end = self._ends
        n, m, way = normals[start], normals[end], points[end] - points[start]
        bend = np.einsum("ij,ij->i", way, n)[:, None] * n - np.einsum("ij,ij->i", way, m)[:, None] * m
        return np.concatenate([points, 0.5 * (points[start] + points[end]) - self._curved * bend])


def _split_vertices(
    rest: Vector, triangles: Indices, kinds: NDArray[np.uint8] | None
) -> tuple[Indices, Indices]:
    """Return the triangles as vertex indices, shape (f, 3), and the node of each vertex, shape (v,).

    Two corners at a node are one vertex if a path across edges that are not sharp leads from one to the
    other.
    """
    a, b, c = (rest[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    one, other = _smooth_pairs(triangles, normals, kinds)
    label = np.arange(triangles.size)
    while True:
        lowest = np.minimum(label[one], label[other])
        before = label.copy()
        np.minimum.at(label, one, lowest)
        np.minimum.at(label, other, lowest)
        if np.array_equal(label, before):
            break
    kept, corners = np.unique(label, return_inverse=True)
    return corners.reshape(-1, 3), triangles.ravel()[kept]


def _smooth_pairs(
    triangles: Indices, normals: Vector, kinds: NDArray[np.uint8] | None
) -> tuple[Indices, Indices]:
    """Return pairs of corners, shape (p,) each, that share a node and an edge that is not sharp.

    A corner has the number 3 face + corner.
    """
    corner = np.arange(triangles.size).reshape(-1, 3)
    # (3 f, 2): the corners of each side
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=-1).reshape(-1, 2)
    nodes = triangles.ravel()[ends]
    ends = np.where((nodes[:, :1] > nodes[:, 1:]), ends[:, ::-1], ends)
    _, edge_of, count = np.unique(np.sort(nodes, axis=1), axis=0, return_inverse=True, return_counts=True)
    edge_of = edge_of.ravel()
    order = np.argsort(edge_of, kind="stable")
    pairs = order[(count == 2)[edge_of[order]]].reshape(-1, 2)  # (e, 2): the two sides of each inner edge
    flat = np.einsum("ij,ij->i", normals[pairs[:, 0] // 3], normals[pairs[:, 1] // 3]) > cos(_CREASE)
    if kinds is not None:
        flat &= kinds[pairs[:, 0] // 3] == kinds[pairs[:, 1] // 3]
    one, other = ends[pairs[flat, 0]], ends[pairs[flat, 1]]  # (e, 2)
    return one.ravel(), other.ravel()
