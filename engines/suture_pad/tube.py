"""A line for drawing: a tube around nodes, open at both ends."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["surface", "triangles"]

_SIDES = 5
"""Number of sides. At an angle of 72 degrees a skin is drawn round (`engines.mujoco.pictures.skin_mesh`)."""
_ANGLES = 2.0 * pi / _SIDES * np.arange(_SIDES)
_ROUND = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)


def surface(nodes: Vector, radius: float) -> Vector:
    """Return consecutive rings of points around `nodes`, shape (n, 3): shape (n sides, 3), m."""
    ways = np.gradient(nodes, axis=0)
    ways /= np.maximum(np.sqrt((ways * ways).sum(axis=1, keepdims=True)), 1e-12)
    sides = np.empty_like(ways)
    side = np.eye(3)[int(np.abs(ways[0]).argmin())]
    for at, way in enumerate(ways):  # carried along without a twist
        side = side - (side @ way) * way
        sides[at] = side = side / np.sqrt(side @ side)
    others = np.cross(ways, sides)
    across = _ROUND[:, :1] * sides[:, None] + _ROUND[:, 1:] * others[:, None]
    return (nodes[:, None] + radius * across).reshape(-1, 3)


def triangles(segments: int) -> NDArray[np.uint32]:
    """Return the triangles of the surface around a line of so many segments, shape (f, 3).

    The triangles are indices of points, counter-clockwise from outside.
    """
    ring = np.arange(_SIDES)
    starts = _SIDES * np.arange(segments)[:, None]
    a, b = starts + ring, starts + np.roll(ring, -1)
    c, d = a + _SIDES, b + _SIDES
    faces = np.concatenate([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)])
    return faces.reshape(-1, 3).astype(np.uint32)
