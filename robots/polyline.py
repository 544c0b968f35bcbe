"""A point beside a line of straight pieces."""

from __future__ import annotations

import numpy as np

from schemas.vectors import Vector

__all__ = ["nearest_feet"]


def nearest_feet(points: Vector, point: Vector) -> tuple[Vector, Vector]:
    """Return the place on each piece nearest to a point, as a share of the piece, and its distance, (k - 1,).

    points: of the line, shape (k, 3). point: shape (3,).
    """
    starts, ways = points[:-1], np.diff(points, axis=0)
    squares = np.maximum((ways * ways).sum(axis=1), 1e-18)
    shares: Vector = np.clip(((point - starts) * ways).sum(axis=1) / squares, 0.0, 1.0)
    distances: Vector = np.linalg.norm(starts + shares[:, None] * ways - point, axis=1)
    return shares, distances
