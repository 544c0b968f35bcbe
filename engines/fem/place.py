"""Where a sphere touches a surface, in C."""

from __future__ import annotations

import numpy as np

from engines.tissue.probes.near_faces import NearFaces
from engines.tissue.probes.place import Place, Surface, shares_of
from schemas.vectors import Vector

__all__ = ["find_place"]


def find_place(surface: Surface, near: NearFaces, radius: float) -> Place:
    """Return the place of a sphere of `radius` (m) near these faces: `find_place` of tissue, to the bit."""
    from engines.fem._probe import closest_on_faces, sum_at_nodes

    _, faces, weights, distances = near
    share = shares_of(distances, radius)
    weighted = (share / share.sum())[:, None] * weights
    corners = surface.settled[faces]
    point: Vector = np.einsum("fa,fai->i", weighted, corners)
    at, away, normals = np.zeros(faces.shape), np.zeros(len(faces)), np.zeros(faces.shape)
    closest_on_faces(point, corners, at, away, normals)
    normal = share @ normals
    first = int(away.argmin())
    nodes, parts = np.zeros(faces.size, np.int64), np.zeros((faces.size, 2))
    count = sum_at_nodes(faces, weighted, first, at[first], nodes, parts)
    return Place(
        surface,
        nodes[:count],
        parts[:count, 0].copy(),
        parts[:count, 1].copy(),
        point,
        -normal / np.sqrt(normal @ normal),
        float(distances.min()),
    )
