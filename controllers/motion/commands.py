"""CRTK's motion commands to one arm: from a message to what its drives are to do.

Whatever is wrong with a command raises MotionError before anything has changed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controllers.motion import goals
from controllers.motion.drives import Drives, WrenchFrame
from controllers.motion.frames import Frames
from robots.dvrk.cart import inverse_pose
from robots.dvrk.inverse import inverse as inverse_kinematics
from robots.dvrk.setup_joints import CartArm
from schemas.errors import MotionError
from schemas.ros import BoolMessage, EmptyMessage, Float64Message, JointState, PoseStamped, WrenchStamped
from schemas.vectors import Vector

__all__ = ["Commands"]


class Commands:
    """What carries out the commands of one arm, by their names, in `handlers`; those of its jaw or hand by `gripper/...`."""

    def __init__(self, arm: CartArm, drives: Drives, frames: Frames, camera: Callable[[], Vector | None], period: float) -> None:
        """Take the arm, its drives, the base frames, what returns the ECM's tip in `ECM_base`, and the controller's step (s)."""
        self._arm: CartArm = arm
        self._drives, self._frames, self._camera, self._period = drives, frames, camera, period
        self._joints, self._chain = drives.joints, drives.joints.chain
        self.ratio = np.ones(1)
        """Share of the limits that moves use."""
        self.gravity_compensation = np.ones(1)
        """1: the drives bear the weight that the controller knows, 0: they do not."""
        self.state = (self.ratio, self.gravity_compensation)
        self.handlers: Mapping[str, Callable[[Any], None]] = {
            "use_gravity_compensation": self._use_gravity_compensation,
            "trajectory_j/set_ratio": self._set_ratio,
            "hold": self._hold,
            "free": self._free,
            "servo_jp": self._servo_jp,
            "servo_jr": self._servo_jr,
            "servo_cp": self._servo_cp,
            "servo_jf": self._servo_jf,
            "body/servo_cf": self._body_servo_cf,
            "spatial/servo_cf": self._spatial_servo_cf,
            "move_jp": self._move_jp,
            "move_jr": self._move_jr,
            "move_cp": self._move_cp,
            "gripper/servo_jp": self._gripper_servo_jp,
            "gripper/servo_jf": self._gripper_servo_jf,
            "gripper/move_jp": self._gripper_move_jp,
        }

    def _use_gravity_compensation(self, message: BoolMessage) -> None:
        self.gravity_compensation[0] = message.data

    def _set_ratio(self, message: Float64Message) -> None:
        if not 0.0 < message.data <= 1.0:
            raise MotionError(f"ratio {message.data:g}, allowed are over 0 to 1")
        self.ratio[0] = message.data

    def _hold(self, _: EmptyMessage) -> None:
        self._drives.rest()

    def _free(self, _: EmptyMessage) -> None:
        self._drives.apply(self._joints, np.zeros(len(self._chain.joints)))

    def _servo_jp(self, message: JointState) -> None:
        self._follow(goals.joint_values(self._chain, message, "position"))

    def _servo_jr(self, message: JointState) -> None:
        self._follow(self._joints.newest_goal + goals.joint_values(self._chain, message, "position"))

    def _servo_cp(self, message: PoseStamped) -> None:
        self._follow(self._solve(message))

    def _servo_jf(self, message: JointState) -> None:
        self._drives.apply(self._joints, goals.efforts(self._chain, message))

    def _body_servo_cf(self, message: WrenchStamped) -> None:
        goals.check_frame(message.header.frame_id, f"{self._arm}_tip")
        self._drives.press(goals.wrench(message), WrenchFrame.BODY)

    def _spatial_servo_cf(self, message: WrenchStamped) -> None:
        goals.check_frame(message.header.frame_id, f"{self._arm}_base")
        self._drives.press(goals.wrench(message), WrenchFrame.SPATIAL)

    def _move_jp(self, message: JointState) -> None:
        self._move(goals.joint_values(self._chain, message, "position"))

    def _move_jr(self, message: JointState) -> None:
        self._move(self._joints.newest_goal + goals.joint_values(self._chain, message, "position"))

    def _move_cp(self, message: PoseStamped) -> None:
        self._move(self._solve(message))

    def _follow(self, goal: Vector) -> None:
        self._drives.follow(self._joints, goal, self._period)

    def _move(self, goal: Vector) -> None:
        self._drives.move(self._joints, goal, float(self.ratio[0]))

    def _solve(self, message: PoseStamped) -> Vector:
        """Return the joint positions, shape (n,), nearest to the setpoint, of a pose in the reference or in the arm's base frame."""
        local = f"{self._arm}_base"
        frame = goals.check_frame(message.header.frame_id, self._frames.names[self._arm], local)
        tip = goals.tip_frame(message)
        if frame != local:
            tip = inverse_pose(self._frames.of(self._arm, self._camera())) @ tip
        return inverse_kinematics(self._chain, tip, self._joints.setpoint.position)

    def _gripper_servo_jp(self, message: JointState) -> None:
        if (gripper := self._drives.gripper) is not None:
            self._drives.follow(gripper, goals.joint_values(gripper.chain, message, "position"), self._period)

    def _gripper_servo_jf(self, message: JointState) -> None:
        if (gripper := self._drives.gripper) is not None:
            self._drives.apply(gripper, goals.efforts(gripper.chain, message))

    def _gripper_move_jp(self, message: JointState) -> None:
        if (gripper := self._drives.gripper) is not None:
            self._drives.move(gripper, goals.joint_values(gripper.chain, message, "position"), float(self.ratio[0]))
