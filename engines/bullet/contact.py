"""What Bullet's contacts lose of a force, and the gain that makes up for it.

Where a rigid body touches a face of a soft body at barycentric coordinates w, Bullet spreads the impulse over the three nodes
with weights 2 w / (1 + s), s = w . w, and takes the sum of w times weight as the inverse mass of the face
(btSoftBodyInternals.h, CollideSDF_RDF). Of an impulse J on the rigid body the soft body then receives only 4 s / (1 + s)^2 J: all
of it at a node, 8/9 in the middle of an edge, 3/4 in the middle of a face. A force on the rigid body must be larger by the
inverse for the tissue to feel it whole.
"""

from __future__ import annotations

import numpy as np

from engines.bullet.mesh import Indices
from schemas.vectors import Vector

__all__ = ["closest_points", "contact_gain"]

_BAND_M = 6e-4
"""Faces nearer to the sphere than this share its force, the nearest most: fitted to the reaction at the anchors (tests/engines/test_bullet_force.py)."""


def contact_gain(centre: Vector, radius: float, nodes: Vector, faces: Indices) -> float:
    """Return by how much a force (1 to 4/3) on a sphere must be larger than what the soft body under it shall receive.

    Args:
        centre: of the sphere, m, shape (3,).
        radius: of the sphere, m.
        nodes: of the soft body, m, shape (n, 3).
        faces: that may be touched, shape (f, 3).
    """
    reach = radius + _BAND_M
    corners = nodes[faces]  # (f, 3, 3)
    near = ((corners.min(axis=1) < centre + reach) & (corners.max(axis=1) > centre - reach)).all(axis=1)
    if not near.any():
        return 1.0
    weights, distance = closest_points(centre, corners[near])
    share = np.maximum(reach - distance, 0.0)
    if not share.any():
        return 1.0
    s = np.einsum("fi,fi->f", weights, weights)
    return float(share @ ((1.0 + s) ** 2 / (4.0 * s)) / share.sum())


def closest_points(point: Vector, corners: Vector) -> tuple[Vector, Vector]:
    """Return the barycentric coordinates, shape (f, 3), of the points of triangles nearest to `point` (m), and their distances (m).

    The nearest point is the foot of the perpendicular if that lies inside, else it lies on an edge.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal, to_point = np.cross(b - a, c - a), point - a
    square = np.einsum("fi,fi->f", normal, normal)
    on_c = np.einsum("fi,fi->f", np.cross(b - a, to_point), normal) / square
    on_b = np.einsum("fi,fi->f", np.cross(to_point, c - a), normal) / square
    candidates = np.zeros((4, len(corners), 3))
    candidates[0] = np.stack([1.0 - on_b - on_c, on_b, on_c], axis=1)
    for i, (start, end) in enumerate(((0, 1), (1, 2), (2, 0)), start=1):
        edge = corners[:, end] - corners[:, start]
        along = np.clip(np.einsum("fi,fi->f", point - corners[:, start], edge) / np.einsum("fi,fi->f", edge, edge), 0.0, 1.0)
        candidates[i, :, start], candidates[i, :, end] = 1.0 - along, along
    distance = np.linalg.norm(np.einsum("kfi,fij->kfj", candidates, corners) - point, axis=2)
    distance[0, (candidates[0] < 0.0).any(axis=1)] = np.inf
    best, face = distance.argmin(axis=0), np.arange(len(corners))
    return candidates[best, face], distance[best, face]
