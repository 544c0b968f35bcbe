"""CRTK's commands to an arm in joint space: from messages to commands to the drives.

An invalid command raises MotionError before any change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controllers.motion import goals
from controllers.motion.drives import Drives
from hub.participant import Record, array, flag
from robots.limits import TOLERANCE, distinct
from schemas.errors import MotionError
from schemas.ros import BoolMessage, EmptyMessage, Float64Message, JointState
from schemas.vectors import Vector

__all__ = ["Commands"]


class CommandState(Record):
    """Settings of an arm."""

    ratio = array(2)
    """Fractions of velocity and of acceleration for moves."""
    gravity_compensation = flag(start=True)
    """Whether the drives carry the weight known to the controller."""


class Commands:
    """Executes the commands of an arm in joint space: `handlers`, by name.

    Commands of jaw or hand are `gripper/...`.
    """

    def __init__(self, drives: Drives, period: float) -> None:
        """`period`: the controller's step, s."""
        self._drives, self._period = drives, period
        self._joints = drives.joints
        self.settings = CommandState()
        self.settings.ratio[:] = 1.0
        self.handlers: Mapping[str, Callable[[Any], None]] = {
            "use_gravity_compensation": self._use_gravity_compensation,
            "trajectory_j/set_ratio": self._set_ratio,
            "trajectory_j/set_ratio_v": self._set_ratio_v,
            "trajectory_j/set_ratio_a": self._set_ratio_a,
            "hold": self._hold,
            "free": self._free,
            "servo_jp": self._servo_jp,
            "servo_jr": self._servo_jr,
            "servo_jf": self._servo_jf,
            "move_jp": self._move_jp,
            "move_jr": self._move_jr,
            "gripper/servo_jp": self._gripper_servo_jp,
            "gripper/servo_jf": self._gripper_servo_jf,
            "gripper/move_jp": self._gripper_move_jp,
        }

    def _use_gravity_compensation(self, message: BoolMessage) -> None:
        self.settings.gravity_compensation = message.data

    def _set_ratio(self, message: Float64Message) -> None:
        self.settings.ratio[:] = _share(message)

    def _set_ratio_v(self, message: Float64Message) -> None:
        self.settings.ratio[0] = _share(message)

    def _set_ratio_a(self, message: Float64Message) -> None:
        self.settings.ratio[1] = _share(message)

    def _hold(self, _: EmptyMessage) -> None:
        self._drives.rest()

    def _free(self, _: EmptyMessage) -> None:
        self._drives.apply(self._joints, np.zeros(len(self._joints.chain.joints)))

    def _servo_jp(self, message: JointState) -> None:
        goal, velocity = (
            goals.joint_values(self._joints.chain, message, "position"),
            goals.stated_velocity(self._joints.chain, message),
        )
        self._drives.follow(self._joints, goal, self._period, velocity)

    def _servo_jr(self, message: JointState) -> None:
        goal = self._joints.newest_goal + goals.joint_values(self._joints.chain, message, "position")
        self._drives.follow(self._joints, goal, self._period)

    def _servo_jf(self, message: JointState) -> None:
        self._drives.apply(self._joints, goals.efforts(self._joints.chain, message))

    def _move_jp(self, message: JointState) -> None:
        self._move(goals.joint_values(self._joints.chain, message, "position"))

    def _move_jr(self, message: JointState) -> None:
        self._move(self._joints.newest_goal + goals.joint_values(self._joints.chain, message, "position"))

    def _move(self, goal: Vector) -> None:
        self._drives.move(self._joints, goal, self.settings.ratio)

    def _gripper_servo_jp(self, message: JointState) -> None:
        if (gripper := self._drives.gripper) is not None:
            self._drives.follow(gripper, goals.joint_values(gripper.chain, message, "position"), self._period)

    def _gripper_servo_jf(self, message: JointState) -> None:
        if (gripper := self._drives.gripper) is not None:
            self._drives.apply(gripper, goals.efforts(gripper.chain, message))

    def _gripper_move_jp(self, message: JointState) -> None:
        if (gripper := self._drives.gripper) is not None:
            self._drives.move(
                gripper, goals.joint_values(gripper.chain, message, "position"), self.settings.ratio
            )


def _share(message: Float64Message) -> float:
    if not 0.0 < message.data <= 1.0 + TOLERANCE:
        value = distinct(message.data, 0.0, 1.0)[0]
        raise MotionError(f"ratio {value}, allowed is above 0 and up to 1")
    return min(message.data, 1.0)
