"""The kinematics of one arm for CRTK's services.

These are QueryForwardKinematics and QueryInverseKinematics of crtk_msgs.

Rules and words are the real controller's (jhu-dvrk/sawIntuitiveResearchKit,
core/components/code/mtsIntuitiveResearchKitArm.cpp; jhu-cisst/cisst, cisstRobot/code/robManipulator.cpp): of
fewer joints than the arm has, `forward` gives the link of the last one, the tip's own offset added as if the
tip were there; of none, the base. `forward_kinematics` answers in the arm's reference,
`local/forward_kinematics` in its base frame; `inverse_kinematics` is asked in the base frame, whatever the
reference is.
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

import numpy as np

from robots import rotation
from robots.dvrk import mtm
from robots.dvrk.cannula import Cannula
from robots.dvrk.inverse import inverse
from robots.serial_chain import SerialChain
from robots.transform import matrix_to_pose, rigid_transform
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Answer", "KinematicsQueries"]

_QUATERNION_TOLERANCE = 1e-3
"""Tolerance of a unit quaternion's norm, as for the values of signals (schemas.vectors)."""


class Answer(NamedTuple):
    """Answer of a service."""

    value: Vector
    """Pose (x, y, z, qx, qy, qz, qw), or joint positions, shape (n,)."""
    result: bool
    message: str


class KinematicsQueries:
    """Answers for an arm with a given instrument or endoscope; keeps no state."""

    def __init__(self, chain: SerialChain) -> None:
        """`chain`: kinematics of a PSM, the ECM or a master, rows in modified Denavit-Hartenberg form."""
        self._chain = chain
        self._cannula = None if len(chain.joints) == len(mtm.JOINT_NAMES) else Cannula.of(chain)

    def forward(self, jp: Vector, base: Vector | None = None) -> Answer:
        """Return the pose at joint positions `jp`, shape (m,) with m from 0 to n, in range or not.

        Args:
            jp: of the first m joints.
            base: pose of the arm's base frame in its reference, (x, y, z, qx, qy, qz, qw), as
            `SUJ/<arm>/measured_cp` publishes it;
                None for `local/forward_kinematics`.
        """
        nowhere, n = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), len(self._chain.joints)
        if jp.size > n:
            return Answer(nowhere, False, f"too many joints: {jp.size}, allowed are up to {n}")
        if not np.isfinite(jp).all():
            return Answer(nowhere, False, f"not all joint positions are finite: {jp.tolist()}")
        frame = np.eye(4)
        if jp.size:
            frame = (
                self._chain.frames(np.concatenate([jp, np.zeros(n - jp.size)]))[jp.size - 1] @ self._chain.tip
            )
        if base is not None:
            frame = _frame(base) @ frame
        return Answer(matrix_to_pose(frame), True, "")

    def inverse(self, cp: Vector, jp: Vector) -> Answer:
        """Return the joint positions, shape (n,), inside the ranges, with the tip at `cp`.

        They are those nearest to `jp`, shape (n,).

        `cp` is (x, y, z, qx, qy, qz, qw) in the arm's base frame. Where there is no answer the value is `jp`.
        """
        n = len(self._chain.joints)
        if jp.size != n:
            return Answer(jp, False, f"incorrect number of joints: {jp.size}, expected {n}")
        try:
            q = inverse(self._chain, _frame(cp), jp)
            if self._cannula is not None:
                self._cannula.check(q, jp)
        except MotionError as error:
            return Answer(jp, False, f"inverse kinematics failed: {error}")
        return Answer(q, True, "")


def _frame(pose: Vector) -> Vector:
    """Return the pose as (4, 4) matrix. Raises MotionError if its quaternion is none."""
    norm = hypot(*pose[3:].tolist())
    if not abs(norm - 1.0) <= _QUATERNION_TOLERANCE:
        raise MotionError(
            f"quaternion (x, y, z, w) has norm {norm:.6g}, allowed is 1 within {_QUATERNION_TOLERANCE:g}"
        )
    return rigid_transform(rotation.matrix(pose[3:] / norm), pose[:3])
