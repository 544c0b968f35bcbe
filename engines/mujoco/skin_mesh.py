"""From the coarse triangles of a soft body to a surface that looks smooth: sharp edges kept, every triangle curved into four.

The nodes stay where they are; between them the surface follows the cubic edge of a curved point-normal triangle (Vlachos, Peters, Boyd,
Mitchell: Curved PN Triangles, I3D 2001): the middle of the edge from a to b with unit normals n and m there, and d = b - a, is
(a + b)/2 - ((d . n) n - (d . m) m)/8. It depends on the edge alone, so neighbours meet without a gap.
"""

from __future__ import annotations

from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["SkinMesh"]

Indices = NDArray[np.int64]

_CREASE = radians(60.0)
"""Faces that meet at a greater angle at rest (0: in one plane) meet at a sharp edge, as those of a box do. A curved organ of few nodes
(10 mm apart at 20 mm radius of curvature) has 30 degrees between its faces."""


class SkinMesh:
    """The displayed surface of a soft body. A vertex on a sharp edge stands once for each smooth face that it bounds."""

    def __init__(self, rest: Vector, triangles: Indices) -> None:
        """Take the nodes at rest, shape (n, 3), m, and the surface, node indices of shape (f, 3), counter-clockwise from outside."""
        corners, self._node = _split(rest, triangles)  # (f, 3), (v,)
        self._corners = corners
        by_vertex = np.argsort(corners.ravel(), kind="stable")
        self._around = by_vertex // 3
        self._first = np.searchsorted(corners.ravel()[by_vertex], np.arange(len(self._node)))
        sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)  # (3 f, 2)
        self._edges, edge_of, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
        self._curved = (count == 2)[:, None] / 8.0
        middles = len(self._node) + edge_of.reshape(-1, 3)  # of the sides 01, 12, 20
        a, b, c = corners.T
        ab, bc, ca = middles.T
        self.faces: Indices = np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1).reshape(-1, 3)
        """Vertex indices, shape (4 f, 3), counter-clockwise from outside."""

    def vertices(self, nodes: Vector) -> Vector:
        """Return the vertices, shape (v, 3), m, for `nodes`, shape (n, 3), m: first those at nodes, then those between them."""
        points = nodes[self._node]
        a, b, c = (points[self._corners[:, i]] for i in range(3))
        areas = np.cross(b - a, c - a)
        normals = np.add.reduceat(areas[self._around], self._first, axis=0)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        start, end = self._edges.T
        n, m, way = normals[start], normals[end], points[end] - points[start]
        bend = np.einsum("ij,ij->i", way, n)[:, None] * n - np.einsum("ij,ij->i", way, m)[:, None] * m
        return np.concatenate([points, 0.5 * (points[start] + points[end]) - self._curved * bend])


def _split(rest: Vector, triangles: Indices) -> tuple[Indices, Indices]:
    """Return the corners of the triangles as vertex indices, shape (f, 3), and the node of each vertex, shape (v,).

    Two corners at a node are one vertex if one can go from one to the other across edges that are not sharp.
    """
    a, b, c = (rest[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    one, other = _smooth_pairs(triangles, normals)
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


def _smooth_pairs(triangles: Indices, normals: Vector) -> tuple[Indices, Indices]:
    """Return pairs of corners (numbered 3 face + corner), shape (p,) each, that share a node and an edge which is not sharp."""
    corner = np.arange(triangles.size).reshape(-1, 3)
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=-1).reshape(-1, 2)  # (3 f, 2): the corners of each side
    nodes = triangles.ravel()[ends]
    ends = np.where((nodes[:, :1] > nodes[:, 1:]), ends[:, ::-1], ends)
    _, edge_of, count = np.unique(np.sort(nodes, axis=1), axis=0, return_inverse=True, return_counts=True)
    edge_of = edge_of.ravel()
    order = np.argsort(edge_of, kind="stable")
    pairs = order[(count == 2)[edge_of[order]]].reshape(-1, 2)  # (e, 2): the two sides of each inner edge
    flat = np.einsum("ij,ij->i", normals[pairs[:, 0] // 3], normals[pairs[:, 1] // 3]) > cos(_CREASE)
    one, other = ends[pairs[flat, 0]], ends[pairs[flat, 1]]  # (e, 2)
    return one.ravel(), other.ravel()
