"""Commands to a master with motors.

The master turns as the tip does, floats while leading, and keeps the orientation while the clutch is
pressed. As jhu-dvrk/sawIntuitiveResearchKit, mtsTeleOperationPSM.cpp (RunAligningMTM, EnterEnabled, Clutch)
does.
"""

from __future__ import annotations

from math import radians

import numpy as np

from controllers.dvrk_console.ports import NO_GRIPPER, EventOutputs
from robots import rotation
from schemas.ros import BoolMessage, EmptyMessage, Point, Pose, PoseStamped, Quaternion, WrenchStamped
from schemas.vectors import Vector

__all__ = ["Master", "opening", "orientation_offset"]

_GRIPPER_ZERO, _GRIPPER_MAX = 0.0, radians(60.0)
"""Angles of a gripper closed and open (mtsIntuitiveResearchKit.h: GripperZero, GripperMax)."""


class Master:
    """The commands to a master."""

    def __init__(self, name: str, events: EventOutputs) -> None:
        """Create the outputs of a master, such as `MTMR`; `events`: destination of the commands."""
        self._name, self._events = name, events

    def hold(self) -> None:
        """Stay."""
        self._events.publish(f"{self._name}/hold", EmptyMessage())

    def turn(self, where: Vector, orientation: Vector) -> None:
        """Stay at the position of `where` but turn to `orientation`, the tip's in the camera's frame.

        Args:
            where: pose of the master (x, y, z, qx, qy, qz, qw).
            orientation: quaternion (x, y, z, w).
        """
        position = Point(**dict(zip("xyz", where[:3].tolist(), strict=True)))
        pose = Pose(position=position, orientation=_quaternion(orientation))
        self._events.publish(f"{self._name}/move_cp", PoseStamped(pose=pose))

    def float_free(self, locked: Vector | None) -> None:
        """Follow the hand without a force; keep the orientation `locked` (x, y, z, w), if any."""
        self._events.publish(f"{self._name}/use_gravity_compensation", BoolMessage(data=True))
        self._events.publish(f"{self._name}/body/servo_cf", WrenchStamped())
        if locked is None:
            self._events.publish(f"{self._name}/unlock_orientation", EmptyMessage())
        else:
            self._events.publish(f"{self._name}/lock_orientation", _quaternion(locked))


def opening(angle: float) -> float:
    """Return the opening 0 .. 1 of a gripper at `angle` (rad); negative if there is none."""
    return (
        -1.0
        if angle <= NO_GRIPPER
        else min(max((angle - _GRIPPER_ZERO) / (_GRIPPER_MAX - _GRIPPER_ZERO), 0.0), 1.0)
    )


def orientation_offset(master: Vector, tip: Vector) -> Quaternion:
    """Return the orientation of the tip relative to the master's.

    Both are quaternions (x, y, z, w) in frames with corresponding axes: the camera's and the display's.
    """
    return _quaternion(rotation.product(rotation.conjugate(master), tip))


def _quaternion(value: Vector) -> Quaternion:
    return Quaternion(**dict(zip("xyzw", (value / np.linalg.norm(value)).tolist(), strict=True)))
