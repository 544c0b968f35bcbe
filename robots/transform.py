"""Rigid transforms: poses (x, y, z, qx, qy, qz, qw), shape (7,), and homogeneous matrices, shape (4, 4).

The matrix of frame b in frame a maps points of b to points of a; `a_from_b @ b_from_c` composes. Metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots import rotation
from schemas.vectors import Vector

__all__ = ["inverse_transform", "matrix_to_pose", "pose_to_matrix", "rigid_transform", "translation"]


def pose_to_matrix(pose: Vector) -> Vector:
    """Return the matrix, shape (4, 4), of a pose, shape (7,)."""
    return rigid_transform(rotation.matrix(pose[3:]), pose[:3])


def matrix_to_pose(matrix: Vector) -> Vector:
    """Return the pose, shape (7,), of a matrix, shape (4, 4)."""
    return np.concatenate([matrix[:3, 3], rotation.from_matrix(matrix)])


def rigid_transform(turn: Vector, position: Vector | Sequence[float]) -> Vector:
    """Return the matrix, shape (4, 4), of a rotation matrix, shape (3, 3), and a position, shape (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, position
    return matrix


def translation(x: float, y: float, z: float) -> Vector:
    """Return the matrix, shape (4, 4), of a displacement."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def inverse_transform(matrix: Vector) -> Vector:
    """Return the inverse of rigid transforms, shape (..., 4, 4)."""
    inverse = matrix.copy()
    inverse[..., :3, :3] = matrix[..., :3, :3].swapaxes(-1, -2)
    inverse[..., :3, 3:] = -inverse[..., :3, :3] @ matrix[..., :3, 3:]
    return inverse
