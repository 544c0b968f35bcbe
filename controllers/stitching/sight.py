"""An arm's joint errors (yaw, pitch and insertion) from pictures of its tip.

An arm that measures q, with its first three joints off by e, has the tip at f(q + e). A Kalman filter of
the constant e processes each sighting of the tip with its covariance; three numbers of a point give three
joints. To everything else the arm then seems to stand a little elsewhere: at the place that makes the
measured tip agree with the pictures. SI units, radians.
"""

from __future__ import annotations

from math import radians, sqrt

import numpy as np

from hub.participant import Record, array, flag
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform
from schemas.ros import PoseWithCovarianceStamped
from schemas.vectors import Vector

__all__ = ["Sight"]

_WITHIN = np.array([radians(5.0), radians(5.0), 5e-3])
"""Bounds of the errors (rules of the Surgical Robotics Challenge); all values between are equally likely."""
_KNOWN = 0.3e-3
"""Largest standard deviation of the tip, along the worst axis, before the arm goes to work, m: a tenth of
the room of an open jaw on either side of a wire.
"""
_ITERATIONS = 5
"""Each leaves the square of the remaining error, in shares of the way to the remote centre: 1e-1 at first."""
_SLOW = 10e-3
"""m/s; faster, a tip has moved too far from its place in the picture when the picture comes."""


class SightState(Record):
    """Estimate of an arm's joint errors."""

    error = array(3)
    """True less measured positions of yaw, pitch (rad) and insertion (m)."""
    covariance = array(3, 3)
    last = array(3)
    """Where the tip was measured in the last step, m."""
    known = flag()


class Sight:
    """An arm in the pictures of the cameras."""

    def __init__(self, chain: SerialChain, base: Vector) -> None:
        """Accept the arm's kinematics and the pose of its base in the world, shape (4, 4)."""
        self._chain, self._base = chain, base
        self.state = SightState()
        self.state.covariance[:] = np.diag(_WITHIN**2 / 3.0)

    @property
    def is_known(self) -> bool:
        """Whether the errors have once been known well enough to go to work."""
        return self.state.known

    def observe_tip(self, q: Vector, seen: tuple[PoseWithCovarianceStamped, ...], period: float) -> Vector:
        """Return where the arm seems to stand, shape (4, 4), with measured joints `q` (6,) and new sightings.

        Sightings are positions in the world, m, with their covariance; `period` is since the last call, s.
        """
        state, there = self.state, self._chain.forward(q)
        way = there[:3, 3] - state.last
        if sqrt(float(way @ way)) <= _SLOW * period:
            for one in seen:
                self._learn_sighting(q, one)
        state.last[:] = there[:3, 3]
        return self._base @ self._chain.forward(self._joint_offset(q)) @ inverse_transform(there)

    def _joint_offset(self, q: Vector) -> Vector:
        true = q.copy()
        true[:3] += self.state.error
        return true

    def _learn_sighting(self, q: Vector, seen: PoseWithCovarianceStamped) -> None:
        """Process a sighting, with the slope at the end of the estimate (an iterated Kalman filter).

        With the slope at the beginning, 5 degrees off, the first sighting would be wrong by ten times the
        noise across the line of sight, and all later sightings too sure.
        """
        state, place = self.state, seen.pose.pose.position
        noise, begun = seen.pose.covariance.reshape(6, 6)[:3, :3], state.error.copy()
        slope, gain = np.eye(3), np.eye(3)
        for _ in range(_ITERATIONS):
            frames = self._chain.frames(self._joint_offset(q))
            slope = self._base[:3, :3] @ self._chain.jacobian(frames)[:3, :3]
            missing = np.array([place.x, place.y, place.z]) - (self._base @ frames[-1])[:3, 3]
            gain = state.covariance @ slope.T @ np.linalg.inv(slope @ state.covariance @ slope.T + noise)
            state.error[:] = begun + gain @ (missing - slope @ (begun - state.error))
        rest = np.eye(3) - gain @ slope
        state.covariance[:] = rest @ state.covariance @ rest.T + gain @ noise @ gain.T  # Joseph: symmetric
        left = np.linalg.eigvalsh(slope @ state.covariance @ slope.T)[-1]
        state.known |= bool(left < _KNOWN**2)
