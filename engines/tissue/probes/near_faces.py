"""Faces of an organ near the spheres of a probe, and their nearest points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from engines.tissue.meshing.tet_mesh import Indices
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["BAND_M", "CONTACT_PERIOD_NS", "NearFaces", "closest_points", "near_faces"]

CONTACT_PERIOD_NS = 8_000_000
"""Period of readings of the nodes, for the places of contact and the received forces."""

BAND_M = 6e-4
"""Largest distance of faces sharing the force of a sphere; in the first guess the nearest face bears most."""

_NEXT = (1, 2, 0)
"""Corner of a triangle after each."""

_ALL_SIDES = 0b111111
"""The six sides of a box, each a bit."""


class NearFaces(NamedTuple):
    """Pairs of a sphere and a near face, in the order of the spheres, then of the faces."""

    spheres: Indices
    """Numbers of the spheres, shape (p,)."""
    faces: Indices
    """Nodes of the faces, shape (p, 3)."""
    weights: Vector
    """Barycentric coordinates of the faces' nearest points, shape (p, 3)."""
    distances: Vector
    """Distances of the nearest points from the centres, m, shape (p,)."""

    def within(self, reach: Vector) -> NearFaces:
        """Return the pairs with a distance below the `reach` (m) of the sphere, shape (k,)."""
        near = self.distances < reach[self.spheres]
        return NearFaces(self.spheres[near], self.faces[near], self.weights[near], self.distances[near])


def near_faces(centres: Vector, reach: Vector, nodes: Vector, faces: Indices) -> NearFaces:
    """Return all pairs of spheres and faces at a distance below the sphere's `reach`.

    Args:
        centres: centres of the spheres, m, shape (k, 3).
        reach: reach of each sphere, m, shape (k,).
        nodes: nodes of the mesh, m, shape (n, 3).
        faces: the three nodes of each face, shape (f, 3).
    """
    low, high = centres - reach[:, None], centres + reach[:, None]
    close = np.flatnonzero(((nodes.min(axis=0) < high) & (nodes.max(axis=0) > low)).all(axis=1))
    if not close.size:
        return NearFaces(close, np.zeros((0, 3), np.int64), np.zeros((0, 3)), np.zeros(0))
    # A face is near where on each of the six sides of the sphere's box some corner of it is inside.
    inside = np.concatenate([nodes < high[close, None], nodes > low[close, None]], axis=2)  # (c, n, 6)
    sides = np.packbits(inside, axis=2, bitorder="little")[:, :, 0]
    a, b, c = faces.T
    sphere, face = np.nonzero((sides[:, a] | sides[:, b] | sides[:, c]) == _ALL_SIDES)
    sphere, corners = close[sphere], faces[face]
    pairs = NearFaces(sphere, corners, *closest_points(centres[sphere], nodes[corners]))
    return pairs.within(reach)


def closest_points(point: Vector, corners: Vector) -> tuple[Vector, Vector]:
    """Return the points of triangles nearest to `point` (m), common to all or one for each.

    The result has barycentric coordinates, shape (f, 3), and distances (m), shape (f,). The nearest point is
    the foot of the perpendicular inside the triangle, else a point on an edge.
    """
    edges = corners.take(_NEXT, axis=1) - corners  # (f, 3, 3): edge k from corner k
    to_point = np.reshape(point, (-1, 1, 3)) - corners  # (f, 3, 3)
    b, c = edges[:, 0], corners[:, 2] - corners[:, 0]  # from corner 0
    normal = cross(b, c)
    square = np.einsum("fi,fi->f", normal, normal)
    on_c = np.einsum("fi,fi->f", cross(b, to_point[:, 0]), normal) / square
    on_b = np.einsum("fi,fi->f", cross(to_point[:, 0], c), normal) / square
    along = np.einsum("fki,fki->fk", to_point, edges) / np.einsum("fki,fki->fk", edges, edges)
    along = np.minimum(np.maximum(along, 0.0), 1.0)
    candidates = np.zeros((4, len(corners), 3))
    candidates[0, :, 0], candidates[0, :, 1], candidates[0, :, 2] = 1.0 - on_b - on_c, on_b, on_c
    for i in range(3):
        candidates[1 + i, :, i], candidates[1 + i, :, _NEXT[i]] = 1.0 - along[:, i], along[:, i]
    away = np.einsum("kfi,fij->kfj", candidates, corners) - point
    distance = np.sqrt((away * away).sum(axis=2))
    distance[0, (candidates[0] < 0.0).any(axis=1)] = np.inf
    best, face = distance.argmin(axis=0), np.arange(len(corners))
    return candidates[best, face], distance[best, face]
