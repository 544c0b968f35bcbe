"""Rotations as unit quaternions (x, y, z, w), rotation vectors (rad) and 3x3 matrices.

Written in scalars: at four numbers a call, numpy's overhead is ten times the arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sin, sqrt

import numpy as np

from schemas.vectors import Vector

__all__ = ["conjugate", "exp", "from_matrices", "from_matrix", "log", "matrix", "product", "rows", "turn_to"]

_SMALL_ANGLE = 1e-6
"""Below this (rad) the next term of the sine's series is under the rounding error of a double."""

# Of the rows 4 q_i q of `from_matrix`: signs of the diagonal in the four squares 4 q_i^2, entries and signs
# in the six products 4 q_i q_j, and which of these ten make row i.
_SQUARES = np.array([[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0]])
_FIRST, _SECOND = np.array([1, 2, 7, 5, 2, 3]), np.array([3, 6, 5, 7, 6, 1])
_SIGNS = np.array([1.0, 1.0, -1.0, 1.0, -1.0, -1.0])
_ROWS = np.array([[0, 4, 5, 6], [4, 1, 7, 8], [5, 7, 2, 9], [6, 8, 9, 3]])


def product(a: Vector, b: Vector) -> Vector:
    """Return the quaternion a * b, shape (4,): first the rotation b, then a."""
    return np.array(_hamilton_product(a.tolist(), b.tolist()))


def _hamilton_product(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float, float]:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q: Vector) -> Vector:
    """Return the inverse rotation, shape (4,)."""
    x, y, z, w = q.tolist()
    return np.array([-x, -y, -z, w])


def exp(v: Vector) -> Vector:
    """Return the quaternion, shape (4,), of the rotation vector `v` (rad), shape (3,)."""
    x, y, z = v.tolist()
    angle = sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < _SMALL_ANGLE else sin(angle / 2) / angle
    return np.array([scale * x, scale * y, scale * z, cos(angle / 2)])


def log(q: Vector) -> Vector:
    """Return the rotation vector (rad), shape (3,), of at most half a turn, of the quaternion `q`."""
    return np.array(_log(*q.tolist()))


def _log(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    if not w >= 0.0:
        x, y, z, w = -x, -y, -z, -w
    length = sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if length < _SMALL_ANGLE else 2.0 * atan2(length, w) / length
    return scale * x, scale * y, scale * z


def matrix(q: Vector) -> Vector:
    """Return the rotation matrix, shape (3, 3), of the unit quaternion `q`."""
    return np.array(rows(*q.tolist()))


def rows(x: float, y: float, z: float, w: float) -> tuple[tuple[float, float, float], ...]:
    """Return the three rows of the rotation matrix of a unit quaternion, in numbers."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def from_matrix(r: Vector) -> Vector:
    """Return the unit quaternion, shape (4,), of the rotation matrix `r`, (3, 3) or the corner of a (4, 4).

    Each row below is 4 q_i q, so the one with the largest q_i is well scaled for every rotation
    (Bar-Itzhack's observation that q is the dominant eigenvector of this matrix, without the eigenvalues).
    """
    return np.array(_from_rows(*r[:3, :3].tolist()))


def turn_to(goal: Vector, r: Vector) -> tuple[float, float, float]:
    """Return the rotation vector (rad) from the matrix `r`, (3, 3) or the corner of a (4, 4), to `goal`.

    `goal` is a quaternion, shape (4,). The vector is, to the bit, log(product(goal,
    conjugate(from_matrix(r)))), at half of its cost.
    """
    x, y, z, w = _from_rows(*r[:3, :3].tolist())
    return _log(*_hamilton_product(goal.tolist(), (-x, -y, -z, w)))


def _from_rows(
    first: Sequence[float], second: Sequence[float], third: Sequence[float]
) -> tuple[float, float, float, float]:
    """Return the unit quaternion of the matrix with these rows."""
    (a, b, c), (d, e, f), (g, h, i) = first, second, third
    largest, x, y, z, w = 1 + a - e - i, 1 + a - e - i, b + d, c + g, h - f
    if (square := 1 - a + e - i) > largest:
        largest, x, y, z, w = square, b + d, square, f + h, c - g
    if (square := 1 - a - e + i) > largest:
        largest, x, y, z, w = square, c + g, f + h, square, d - b
    if (square := 1 + a + e + i) > largest:
        x, y, z, w = h - f, c - g, d - b, square
    length = sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length


def from_matrices(r: Vector) -> Vector:
    """Return the unit quaternions, shape (m, 4), of many matrices at once, shape (m, 3, 3) or (m, 4, 4).

    They are those of `from_matrix` to the bit: the same operations in the same order.
    """
    entries = r[:, :3, :3].reshape(-1, 9)
    signed = _SQUARES * entries[:, None, ::4]
    squares = 1.0 + signed[..., 0] + signed[..., 1] + signed[..., 2]  # (m, 4)
    products = entries.take(_FIRST, -1) + _SIGNS * entries.take(_SECOND, -1)  # (m, 6)
    parts = np.concatenate([squares, products], axis=-1)  # (m, 10)
    rows: Vector = parts[np.arange(len(r))[:, None], _ROWS.take(squares.argmax(axis=-1), 0)]
    x, y, z, w = (rows * rows).T
    return rows / np.sqrt(x + y + z + w)[:, None]
