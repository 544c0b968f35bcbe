"""Arms led by NVIDIA's IsaacTeleop: the outputs of its retargeters for a PSM as commands of a stream.

IsaacTeleop reads headsets, controllers and gloves in a program of its own. `DVRKPSMClutchRetargeter` gives
`ee_pose`, `DVRKPSMGripperRetargeter` `jaw_targets`, both float32 (NVIDIA/IsaacTeleop, pull request 769,
src/retargeters/DVRK). Clutch, workspace and dwell are theirs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from devices.programs.arm import Arm
from devices.programs.values import Pose
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["IsaacTeleopPsm"]

_OPEN, _CLOSED = (-0.50, 0.50), (-0.09, 0.09)
"""Both fingers at the endpoints, rad: defaults of `DVRKPSMGripperConfig`."""
_UNIT_NORM = 0.01
"""Largest deviation of a quaternion's norm from 1: it has 32 bits."""


class IsaacTeleopPsm:
    """A PSM that follows `ee_pose` and `jaw_targets`."""

    def __init__(
        self, arm: Arm, jaw_open: tuple[float, float] = _OPEN, jaw_closed: tuple[float, float] = _CLOSED
    ) -> None:
        """`jaw_open` and `jaw_closed`: as in `DVRKPSMGripperConfig`, rad.

        Raises MotionError if they are no opening, and what `setpoint_cp` raises.
        """
        self._arm = arm
        self._widest, self._least = (right - left for left, right in (jaw_open, jaw_closed))
        if not 0.0 <= self._least < self._widest:
            raise MotionError(f"{arm.name}: a jaw from {jaw_closed} to {jaw_open} rad does not open")
        self.home: Vector = arm.setpoint_cp().matrix
        """The tip's commanded pose, shape (4, 4), m, in the frame of `measured_cp`.

        It is `home_reference_T_ee` of `DVRKPSMClutchConfig`: so the arm does not jump at the first squeeze.
        """

    def follow(self, ee_pose: ArrayLike, jaw_targets: ArrayLike) -> None:
        """Command a pose and an opening; call it for each frame of IsaacTeleop.

        The opening is the angle between the fingers, stretched so that their closed endpoint shuts the jaw.

        Args:
            ee_pose: x, y, z, m, and qx, qy, qz, qw, in the frame of `measured_cp`, shape (7,).
            jaw_targets: angles of both fingers, rad, shape (2,).

        Raises:
            MotionError: other numbers, or the arm has refused an earlier command of the stream.
        """
        pose = self._numbers("ee_pose", ee_pose, 7)
        left, right = self._numbers("jaw_targets", jaw_targets, 2).tolist()
        norm = float(np.linalg.norm(pose[3:]))
        if abs(norm - 1.0) > _UNIT_NORM:
            raise MotionError(f"{self._arm.name}: the quaternion of ee_pose has norm {norm:.3g}, expected 1")
        share = (right - left - self._least) / (self._widest - self._least)
        self._arm.servo_cp(Pose(pose[:3], pose[3:] / norm))
        self._arm.jaw.servo_jp([min(max(share, 0.0), 1.0) * self._widest])

    def _numbers(self, name: str, values: ArrayLike, size: int) -> Vector:
        numbers = np.asarray(values, np.float64)
        if numbers.shape != (size,) or not np.isfinite(numbers).all():
            raise MotionError(
                f"{self._arm.name}: {name} is {np.asarray(values).tolist()}, expected {size} finite numbers"
            )
        return numbers
