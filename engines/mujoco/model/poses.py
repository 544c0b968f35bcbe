"""Poses in MuJoCo's order, quaternions (w, x, y, z), and in ROS's, (x, y, z, w)."""

from __future__ import annotations

import numpy as np

from robots import rotation
from schemas.vectors import Vector

__all__ = ["ROS_ORDER", "pose_attributes"]

ROS_ORDER = np.array([0, 1, 2, 4, 5, 6, 3])
"""Where each number of a ROS pose (x, y, z, qx, qy, qz, qw) stands in a pose of MuJoCo."""


def pose_attributes(pose: Vector) -> dict[str, list[float]]:
    """Return `pos` and `quat` of an element from the pose in the parent, shape (4, 4)."""
    x, y, z, w = rotation.from_matrix(pose).tolist()
    return {"pos": pose[:3, 3].tolist(), "quat": [w, x, y, z]}
