"""Poses and what is near them: position and rotation, each with its error in the pose's own frame.

An error (6,) is a displacement (m), then a rotation vector (rad), both along the axes of the frame that it is
an error of: p + R displacement, R exp(rotation).
"""

from __future__ import annotations

import numpy as np

from robots import rotation
from schemas.vectors import Vector

__all__ = ["move_pose", "pose_error", "turned_about"]


def move_pose(pose: Vector, error: Vector) -> Vector:
    """Return `pose`, shape (4, 4), moved by an error, shape (6,)."""
    result = pose.copy()
    result[:3, 3] += pose[:3, :3] @ error[:3]
    result[:3, :3] = pose[:3, :3] @ rotation.matrix(rotation.exp(error[3:]))
    return result


def pose_error(pose: Vector, other: Vector) -> Vector:
    """Return the error, shape (6,), that moves `pose` to `other`, both (4, 4)."""
    turn = pose[:3, :3].T
    return np.concatenate(
        [turn @ (other[:3, 3] - pose[:3, 3]), rotation.log(rotation.from_matrix(turn @ other[:3, :3]))]
    )


def turned_about(point: Vector) -> Vector:
    """Return the errors, shape (6, 3), of rotations about the axes through `point` (3,) of the own frame."""
    x, y, z = point.tolist()
    return np.vstack([np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.eye(3)])
