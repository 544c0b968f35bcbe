"""The motion of a stylus' tip in the base frame of REP 103, from transform and velocity of HDAPI."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite

from devices.haptics.contact import ZERO
from devices.vendor_axes import Vector3, vector

__all__ = ["Tip"]

_SMOOTHING = 0.01
"""Time constant for smoothing the angular velocity, s: a Touch's gimbal has potentiometers, and a
hand turns no faster than some Hz.
"""
_UNIT = 0.1
"""Tolerance of an axis' squared length of 1: HDAPI's rotations have small errors, any other matrix large
errors.
"""


class Tip:
    """Pose and twist of a stylus' tip.

    The tip's frame has z out of the point, x to the right and y down when pointing level away from the user.
    """

    def __init__(self, offset: float) -> None:
        """`offset`: from the centre of the gimbal, the point of HDAPI's poses, to the tip, m."""
        self._offset = offset
        self._time = -inf
        self.position: Vector3 = ZERO
        """m."""
        self.rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        """Rotation matrix of the tip's frame, row after row."""
        self.linear: Vector3 = ZERO
        """m/s."""
        self.angular: Vector3 = ZERO
        """rad/s."""

    def move(self, t: Sequence[float], velocity: Sequence[float], now: float) -> bool:
        """Update the motion; return False if the transform is no pose.

        Args:
            t: transform of HDAPI, 16 numbers, column after column, mm.
            velocity: of HDAPI, mm/s.
            now: time of the frame, s.
        """
        # HDAPI's z is towards the user: out of the blunt end
        axes = vector(t[0], t[1], t[2]), vector(-t[4], -t[5], -t[6]), vector(-t[8], -t[9], -t[10])
        x, y, z = vector(t[12] * 1e-3, t[13] * 1e-3, t[14] * 1e-3)
        vx, vy, vz = vector(velocity[0] * 1e-3, velocity[1] * 1e-3, velocity[2] * 1e-3)
        for a, b, c in axes:
            if not abs(a * a + b * b + c * c - 1.0) < _UNIT:
                return False
        if not isfinite(x + y + z + vx + vy + vz):
            return False
        wx, wy, wz = self.angular = self._turn(axes, now)
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = axes
        self.rotation = (xx, yx, zx, xy, yy, zy, xz, yz, zz)
        o = self._offset
        self.position = x + o * zx, y + o * zy, z + o * zz
        self.linear = vx + o * (wy * zz - wz * zy), vy + o * (wz * zx - wx * zz), vz + o * (wx * zy - wy * zx)
        return True

    def _turn(self, axes: tuple[Vector3, Vector3, Vector3], now: float) -> Vector3:
        """Return the smoothed angular velocity.

        The sum of axis x axis' over the three axes of a rotating frame is 2 sin(angle) along the axis of
        rotation. HDAPI has an angular velocity, but does not document the frame, and a driver in use
        (Touch, ROS) notes poor results.
        """
        dt, self._time = now - self._time, now
        if not 0.0 < dt < inf:
            return self.angular
        r = self.rotation
        sx = sy = sz = 0.0
        for i, (ax, ay, az) in enumerate(axes):
            bx, by, bz = r[i], r[3 + i], r[6 + i]
            sx += by * az - bz * ay
            sy += bz * ax - bx * az
            sz += bx * ay - by * ax
        wx, wy, wz = self.angular
        # a first-order low-pass of sum / (2 dt)
        keep, take = _SMOOTHING / (_SMOOTHING + dt), 0.5 / (_SMOOTHING + dt)
        return keep * wx + take * sx, keep * wy + take * sy, keep * wz + take * sz
