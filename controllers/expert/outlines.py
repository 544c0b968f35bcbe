"""Outlines of objects from above, and the room between them. Metres, in the plane of the world's x and y."""

from __future__ import annotations

from math import sqrt

import numpy as np

from robots.training.boards import Ring
from schemas.vectors import Vector

__all__ = ["box_of_ring", "outline_gap", "outline_of_ring"]


def outline_of_ring(ring: Ring, pose: Vector) -> Vector:
    """Return the corners of a ring with `pose`, shape (4, 4), more or less upright, shape (3, 2)."""
    return (_corners(ring) @ pose[:3, :3].T + pose[:3, 3])[:, :2]


def box_of_ring(ring: Ring, pose: Vector) -> tuple[Vector, Vector]:
    """Return the least and greatest coordinates of a ring with any `pose`, shape (4, 4), shape (3,) each."""
    half = np.array([0.0, 0.0, ring.height / 2.0])
    points = np.concatenate([_corners(ring) - half, _corners(ring) + half]) @ pose[:3, :3].T + pose[:3, 3]
    return points.min(axis=0), points.max(axis=0)


def _corners(ring: Ring) -> Vector:
    around = ring.side / sqrt(3.0)  # of the circle through the corners, one of which lies on y
    return around * np.array([[0.0, 1.0, 0.0], [-sqrt(0.75), -0.5, 0.0], [sqrt(0.75), -0.5, 0.0]])


def outline_gap(one: Vector, other: Vector) -> float:
    """Return how far two convex outlines, corners of shape (n, 2), are apart along the normal of one's side.

    That is at most their distance; negative: by how much they overlap (the theorem of separating axes).
    """
    return max(_distance_beyond(one, other), _distance_beyond(other, one))


def _distance_beyond(sides: Vector, points: Vector) -> float:
    """Return how far all `points` are beyond one of the sides, at best."""
    along = np.roll(sides, -1, axis=0) - sides
    normals = np.column_stack([along[:, 1], -along[:, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    middle = sides.mean(axis=0)
    normals *= np.sign(((sides - middle) * normals).sum(axis=1))[:, None]
    off = points @ normals.T - (sides * normals).sum(axis=1)
    return float(off.min(axis=0).max())
