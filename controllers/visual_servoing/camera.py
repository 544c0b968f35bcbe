"""Points as a camera sees them, in normalised coordinates, and which of them it keeps in view."""

from __future__ import annotations

import numpy as np

from schemas.vectors import Vector

__all__ = ["kept_view", "project_points", "seen_points"]


def seen_points(camera: Vector, target: Vector, points: Vector) -> Vector:
    """Return `points` of the target's frame, shape (n, 3), in the camera's frame, shape (n, 3).

    `camera` and `target` are poses in one frame, shape (4, 4).
    """
    inverse = np.linalg.inv(camera) @ target
    return points @ inverse[:3, :3].T + inverse[:3, 3]


def project_points(points: Vector) -> Vector:
    """Return normalised coordinates, shape (n, 2), of points in the camera's frame, shape (n, 3)."""
    return points[:, :2] / points[:, 2:]


def kept_view(camera: Vector, radius: float, margin: float) -> Vector:
    """Return least and largest normalised x and y of centres whose discs are in view, shape (2, 2).

    Args:
        camera: fx, fy, cx, cy, width and height, px.
        radius: of the discs as they are seen, normalised.
        margin: kept from the edges of the picture, px.
    """
    edges = np.array([np.full(2, margin), camera[4:] - 1.0 - margin])
    view = (edges - camera[2:4]) / camera[:2]
    return view + np.array([[radius], [-radius]])
