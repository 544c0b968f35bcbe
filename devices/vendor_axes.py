"""From the axes that HDAPI, LibOVR and OpenXR share (x right, y up, z towards the user) to those of REP 103
(x ahead, y left, z up).

The same turn takes vectors of the base frame and, as these interfaces give a head's own frame the same axes,
the head's own ones: (x, y, z) = (-z_v, -x_v, y_v).
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
    """Return the unit quaternion (x, y, z, w) of a rotation whose two frames both have the vendors' axes,
    with those of REP 103.

    Raises ValueError if it has no direction (all zeros, or not finite): some runtimes give that while they do
    not track.
    """
    norm = sqrt(x * x + y * y + z * z + w * w)
    if not 0.5 < norm < 2.0:  # of single precision; also false for NaN
        raise ValueError(f"({x:g}, {y:g}, {z:g}, {w:g}) is no unit quaternion (x, y, z, w)")
    return -z / norm, -x / norm, y / norm, w / norm
