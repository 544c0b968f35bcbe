"""CRTK's commands to the tip of an arm: from messages to commands to the drives.

An invalid command raises MotionError before any change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from controllers.motion import goals
from controllers.motion.drives import Drives, WrenchFrame
from controllers.motion.frames import BaseFrame, rotate_twist
from robots.dvrk.cannula import Cannula
from robots.dvrk.crtk import tip_frame
from robots.dvrk.inverse import inverse as inverse_kinematics
from robots.dvrk.setup_joints import DrivenArm
from robots.transform import inverse_transform
from schemas.crtk import CartesianImpedance, CartesianState
from schemas.errors import MotionError
from schemas.ros import BoolMessage, PoseStamped, WrenchStamped
from schemas.vectors import Vector

__all__ = ["CartesianCommands"]

_IDENTITY = np.eye(4)
_SINGULAR = 1e-6
"""Singular values of the Jacobian below this share of the largest move no joint; as in `telemetry`."""


class CartesianCommands:
    """Executes the Cartesian commands of an arm: `handlers`, by name."""

    def __init__(self, arm: DrivenArm, drives: Drives, base: BaseFrame, ratio: Vector, period: float) -> None:
        """Prepare the handlers.

        Args:
            arm: name of the arm.
            drives: drives of the arm.
            base: the arm's base frame.
            ratio: fractions of velocity and acceleration for moves, shape (2,); read at each move.
            period: the controller's step, s.
        """
        self._arm, self._drives, self._base, self._ratio, self._period = arm, drives, base, ratio, period
        self._joints = drives.joints
        self.fit()
        self.handlers: Mapping[str, Callable[[Any], None]] = {
            "body/set_cf_orientation_absolute": self._set_cf_orientation_absolute,
            "set_base_frame": self._set_base_frame,
            "servo_cp": self._servo_cp,
            "servo_cr": self._servo_cr,
            "servo_cs": self._servo_cs,
            "servo_ci": self._servo_ci,
            "body/servo_cf": self._body_servo_cf,
            "spatial/servo_cf": self._spatial_servo_cf,
            "move_cp": self._move_cp,
        }

    def fit(self) -> None:
        """Take over the kinematics of the instrument."""
        self._chain = self._joints.chain
        self._cannula = None if self._arm in ("MTML", "MTMR") else Cannula.of(self._chain)

    def not_ready(self) -> str:
        """Return why the arm refuses Cartesian commands; empty: accepted."""
        if self._cannula is None or self._drives.control.cartesian:
            return ""
        return self._cannula.not_past(self._joints.position)

    def _set_cf_orientation_absolute(self, message: BoolMessage) -> None:
        self._drives.control.absolute = message.data

    def _set_base_frame(self, message: PoseStamped) -> None:
        self._base.check_free()
        goals.check_frame(message.header.frame_id, self._base.reference)
        self._base.place(goals.frame(message.pose))

    def _servo_cp(self, message: PoseStamped) -> None:
        self._drives.follow(self._joints, self._solve_pose(message), self._period)

    def _servo_cr(self, message: PoseStamped) -> None:
        step = goals.frame(message.pose)
        axes = self._from(message.header.frame_id)[:3, :3]
        goal = self._chain.forward(self._joints.newest_goal)
        goal[:3, 3] += axes @ step[:3, 3]
        goal[:3, :3] = axes @ step[:3, :3] @ axes.T @ goal[:3, :3]
        self._drives.follow(self._joints, self._inverse_nearest(goal), self._period)

    def _servo_cs(self, message: CartesianState) -> None:
        posed, moved, pushed = (
            message.pose_is_valid.data,
            message.twist_is_valid.data,
            message.wrench_is_valid.data,
        )
        frame = self._from(message.header.frame_id)
        if pushed and (posed or moved):
            raise MotionError(
                "a wrench beside a pose or a twist, allowed is one or the other: the drives apply efforts or"
                " hold positions"
            )
        velocity = (
            self._joint_velocity(rotate_twist(frame[:3, :3], goals.twist(message.twist))) if moved else None
        )
        if posed:
            self._drives.follow(
                self._joints, self._inverse_nearest(frame @ goals.frame(message.pose)), self._period, velocity
            )
        elif velocity is not None:
            self._drives.drift(velocity)
        else:
            wrench = goals.wrench(message.wrench) if pushed else np.zeros(6)
            self._drives.press(
                rotate_twist(self._base.pose[:3, :3] @ frame[:3, :3], wrench), WrenchFrame.REFERENCE
            )

    def _servo_ci(self, message: CartesianImpedance) -> None:
        goals.check_frame(message.header.frame_id, self._base.reference)
        self._drives.resist(message)

    def _body_servo_cf(self, message: WrenchStamped) -> None:
        goals.check_frame(
            message.header.frame_id,
            self._base.reference if self._drives.control.absolute else tip_frame(self._arm),
        )
        self._drives.press(goals.wrench(message.wrench), WrenchFrame.BODY)

    def _spatial_servo_cf(self, message: WrenchStamped) -> None:
        goals.check_frame(message.header.frame_id, self._base.local)
        self._drives.press(goals.wrench(message.wrench), WrenchFrame.SPATIAL)

    def _move_cp(self, message: PoseStamped) -> None:
        self._drives.move(self._joints, self._solve_pose(message), self._ratio)

    def _solve_pose(self, message: PoseStamped) -> Vector:
        """Return the joint positions, shape (n,), of a pose in the reference or in the arm's base frame."""
        return self._inverse_nearest(self._from(message.header.frame_id).dot(goals.frame(message.pose)))

    def _from(self, frame_id: str) -> Vector:
        """Return the pose of a message's frame in the arm's base frame, shape (4, 4).

        An empty name stands for the reference.
        """
        named = goals.check_frame(frame_id, self._base.reference, self._base.local)
        return _IDENTITY if named == self._base.local else inverse_transform(self._base.pose)

    def _inverse_nearest(self, tip: Vector) -> Vector:
        """Return the joint positions, shape (n,), of a pose in the arm's base frame, shape (4, 4).

        Among several solutions, the nearest to the setpoint.
        """
        goal = inverse_kinematics(self._chain, tip, self._joints.setpoint.position)
        if self._cannula is not None:
            self._cannula.check(goal, self._joints.position)
        return goal

    def _joint_velocity(self, twist: Vector) -> Vector:
        """Return the joint velocities, shape (n,), of a twist of the tip in the base frame.

        All velocities are scaled down to respect every limit.
        """
        jacobian = self._chain.jacobian(self._chain.frames(self._joints.setpoint.position))
        velocity = np.linalg.pinv(jacobian, rcond=_SINGULAR) @ twist
        return velocity / max(1.0, float((np.abs(velocity) / self._chain.velocity).max()))
