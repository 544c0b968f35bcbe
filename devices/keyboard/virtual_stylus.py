"""A virtual stylus, moved at the speed commanded by keys and sticks, and at rest without a command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from devices.vendor_axes import Quaternion, Vector3
from robots import rotation
from schemas.vectors import Vector

__all__ = ["NOTHING", "VirtualStylus", "Wish"]

_LEVEL = rotation.from_matrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
"""Orientation level away from the user: z ahead, x to the right, y down; in axes of REP 103."""
_GRIPPER_SPEED = 1.0
"""1/s; ours: from open to closed in the time of an unhurried hand."""


@dataclass(frozen=True, slots=True)
class Wish:
    """A command of keys or sticks: shares of the speeds, each from -1 to 1."""

    linear: Vector3 = (0.0, 0.0, 0.0)
    """Ahead, left, up."""
    angular: Vector3 = (0.0, 0.0, 0.0)
    """Angular shares about the stylus' own axes: x (the point moves up), y (right), z (as a screw going in).
    """
    gripper: float = 0.0
    """1 opens, -1 closes."""
    dead_man: bool = False
    jaw: bool = False
    pedal: bool = False
    """Power of a generator, or suction."""
    rinse: bool = False
    """Saline of a suction irrigator."""
    turn: Vector3 = (0.0, 0.0, 0.0)
    """Angular shares about the axes of the base frame: ahead, left, up."""

    def __add__(self, other: Wish) -> Wish:
        """Return the sum of the commands of two sources."""
        return Wish(
            _sum(self.linear, other.linear),
            _sum(self.angular, other.angular),
            self.gripper + other.gripper,
            self.dead_man or other.dead_man,
            self.jaw or other.jaw,
            self.pedal or other.pedal,
            self.rinse or other.rinse,
            _sum(self.turn, other.turn),
        )


NOTHING = Wish()


def _sum(a: Vector3, b: Vector3) -> Vector3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _limit_speed(share: Vector3, speed: float) -> Vector:
    """Return the velocity, shape (3,), of at most `speed` in any direction."""
    wish = np.array(share)
    return wish * (speed / max(1.0, float(np.linalg.norm(wish))))


class VirtualStylus:
    """Pose and twist in the base frame (x ahead, y left, z up), and opening of the gripper."""

    def __init__(
        self, speed: float, turn_speed: float, stands_for: Literal["stylus", "head"] = "stylus"
    ) -> None:
        """Start at the origin of the base frame.

        Args:
            speed: largest velocity, m/s.
            turn_speed: largest angular velocity, rad/s.
            stands_for: object with the moved frame's axes; a head's are x ahead, y left, z up.
        """
        self._speed, self._turn_speed = speed, turn_speed
        self._axes = np.array([0.0, 0.0, 0.0, 1.0]) if stands_for == "stylus" else rotation.conjugate(_LEVEL)
        self._position, self._orientation = np.zeros(3), _LEVEL
        self._linear, self._angular = np.zeros(3), np.zeros(3)
        self.gripper = 1.0
        """Opening of the gripper: 0 closed, 1 open."""

    def advance(self, wish: Wish, dt: float) -> None:
        """Move for `dt` seconds by the command `wish`."""
        axes = rotation.matrix(self._orientation)
        x, y, z = (np.array(wish.angular) + axes.T @ wish.turn).tolist()
        own = _limit_speed((x, y, z), self._turn_speed)
        self._linear, self._angular = _limit_speed(wish.linear, self._speed), axes @ own
        self._position = self._position + dt * self._linear
        turned = rotation.product(self._orientation, rotation.exp(dt * own))
        self._orientation = turned / np.linalg.norm(turned)
        self.gripper = min(
            max(self.gripper + dt * _GRIPPER_SPEED * min(max(wish.gripper, -1.0), 1.0), 0.0), 1.0
        )

    def follow(self, position: Vector3, orientation: Quaternion, gripper: float, dt: float) -> None:
        """Move for `dt` seconds towards a tracked frame (x ahead, y left, z up), within the speed limits."""
        if dt <= 0.0:
            return
        goal = rotation.product(np.array(orientation), _LEVEL)
        own = rotation.log(rotation.product(rotation.conjugate(self._orientation), goal)) / dt
        ahead, left, up = ((np.array(position) - self._position) / (dt * self._speed)).tolist()
        x, y, z = (own / self._turn_speed).tolist()
        self.advance(Wish(linear=(ahead, left, up), angular=(x, y, z), gripper=gripper), dt)

    def place(self, position: Vector3, orientation: Quaternion) -> None:
        """Stand where a tracked frame (x ahead, y left, z up) is, at rest."""
        self._position = np.array(position)
        self._orientation = rotation.product(np.array(orientation), _LEVEL)
        self._linear, self._angular = np.zeros(3), np.zeros(3)

    @property
    def pose(self) -> tuple[Vector3, Quaternion]:
        """Position (m) and quaternion (x, y, z, w)."""
        x, y, z = self._position.tolist()
        qx, qy, qz, qw = rotation.product(self._orientation, self._axes).tolist()
        return (x, y, z), (qx, qy, qz, qw)

    @property
    def twist(self) -> tuple[Vector3, Vector3]:
        """Velocity (m/s) and angular velocity (rad/s), both along the axes of the base frame."""
        vx, vy, vz = self._linear.tolist()
        wx, wy, wz = self._angular.tolist()
        return (vx, vy, vz), (wx, wy, wz)
