"""Poses as MuJoCo writes them: a position and a quaternion (w, x, y, z)."""

from __future__ import annotations

from robots import rotation
from schemas.vectors import Vector

__all__ = ["placed", "wxyz"]


def wxyz(q: Vector) -> list[float]:
    """Return the quaternion (x, y, z, w) in MuJoCo's order."""
    x, y, z, w = q.tolist()
    return [w, x, y, z]


def placed(pose: Vector) -> dict[str, list[float]]:
    """Return `pos` and `quat` of an element from its pose in its parent, shape (4, 4)."""
    return {"pos": pose[:3, 3].tolist(), "quat": wxyz(rotation.from_matrix(pose))}
