"""Where a scripted hand wants to be.

Between two waypoints it moves as people reach: along a straight line, with the least jerk and at rest at both ends (Flash and Hogan, The coordination of arm
movements, Journal of Neuroscience 5(7), 1985). It turns about one axis, with the same course in time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from devices.haptics.contact import ZERO
from devices.simulated_touch.params import LEVEL, Waypoint
from devices.vendor_axes import Quaternion, Vector3
from robots import rotation

__all__ = ["HandPath"]


class _Stop(NamedTuple):
    position: Vector3
    orientation: Quaternion
    buttons: tuple[bool, bool]


class HandPath:
    """A path in the stylus' base frame, m and rad, over time in s."""

    def __init__(self, waypoints: Sequence[Waypoint]) -> None:
        """Take at least one waypoint, in order. Before the first the hand is there already."""
        self._times = [waypoint.at * 1e-9 for waypoint in waypoints]
        self._stops: list[_Stop] = []
        stop = _Stop(ZERO, LEVEL, (False, False))
        for w in waypoints:
            buttons = stop.buttons if w.buttons is None else (0 in w.buttons, 1 in w.buttons)
            stop = _Stop(w.position or stop.position, w.orientation or stop.orientation, buttons)
            self._stops.append(stop)

    def position(self, t: float) -> tuple[Vector3, Vector3]:
        """Return where the hand wants to be (m), and with which velocity (m/s)."""
        before, after, share, rate = self._between(t)
        (ax, ay, az), (bx, by, bz) = before.position, after.position
        x, y, z = bx - ax, by - ay, bz - az
        return (ax + share * x, ay + share * y, az + share * z), (rate * x, rate * y, rate * z)

    def orientation(self, t: float) -> tuple[Quaternion, Vector3]:
        """Return the orientation (x, y, z, w), and the angular velocity (rad/s), both in the base frame."""
        before, after, share, rate = self._between(t)
        start = np.array(before.orientation)
        turn = rotation.log(rotation.product(np.array(after.orientation), rotation.conjugate(start)))
        x, y, z, w = rotation.product(rotation.exp(share * turn), start).tolist()
        wx, wy, wz = (rate * turn).tolist()
        return (x, y, z, w), (wx, wy, wz)

    def buttons(self, t: float) -> tuple[bool, bool]:
        """Return which of the two buttons are held; before the first waypoint none."""
        index = bisect_right(self._times, t) - 1
        return self._stops[index].buttons if index >= 0 else (False, False)

    def _between(self, t: float) -> tuple[_Stop, _Stop, float, float]:
        """Return the waypoints before and after `t`, the share of the way that is done, and its rate (1/s)."""
        index = bisect_right(self._times, t) - 1
        if index < 0 or index == len(self._times) - 1:
            stop = self._stops[max(index, 0)]
            return stop, stop, 0.0, 0.0
        length = self._times[index + 1] - self._times[index]
        s = (t - self._times[index]) / length
        return self._stops[index], self._stops[index + 1], s * s * s * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) * (1.0 - s) / length
