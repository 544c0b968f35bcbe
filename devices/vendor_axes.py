"""From the axes of HDAPI, LibOVR and OpenXR to those of REP 103.

Theirs are x right, y up, z towards the user; those of REP 103 are x ahead, y left, z up.
The same rotation holds for vectors in the base frame and in the head's own frame, which has the same axes:
(x, y, z) = (-z_v, -x_v, y_v).
"""

from __future__ import annotations

from math import sqrt

__all__ = ["Quaternion", "Vector3", "quaternion", "vector"]

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""


def vector(x: float, y: float, z: float) -> Vector3:
    """Return a vector of the vendors' axes in those of REP 103."""
    return -z, -x, y


def quaternion(x: float, y: float, z: float, w: float) -> Quaternion:
    """Return the unit quaternion (x, y, z, w) of a rotation between two frames with the vendors' axes.

    The result is for the same frames with the axes of REP 103. Raises ValueError if it is no unit
    quaternion (all zeros, or not finite), as some runtimes return while they do not track.
    """
    norm = sqrt(x * x + y * y + z * z + w * w)
    if not 0.5 < norm < 2.0:  # vendors have single precision; also false for NaN
        raise ValueError(f"({x:g}, {y:g}, {z:g}, {w:g}) is no unit quaternion (x, y, z, w)")
    return -z / norm, -x / norm, y / norm, w / norm
