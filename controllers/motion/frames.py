"""Poses as (4, 4) matrices and as ROS has them, and the frames in which the world outside speaks of an arm.

On the real system (jhu-dvrk/sawIntuitiveResearchKit) a PSM is seen from the camera: its base frame there is inv(cart -> camera)
(cart -> RCM), both through the setup joints. The ECM is seen from the cart.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from controllers.motion.params import MotionParams
from robots import rotation
from robots.dvrk import setup_joints
from robots.dvrk.cart import inverse_pose
from robots.dvrk.setup_joints import CartArm
from schemas.vectors import Vector

__all__ = ["CAMERA_FRAME", "CART_FRAME", "Frames", "pose"]

CAMERA_FRAME, CART_FRAME = "ECM", "Cart"
"""As the da Vinci's own interface and the dVRK call them in `header.frame_id`."""


def pose(frame: Vector) -> Vector:
    """Return (x, y, z, qx, qy, qz, qw) of a rigid transformation, shape (4, 4)."""
    return np.concatenate([frame[:3, 3], rotation.from_matrix(frame)])


class Frames:
    """Base frames of all arms in the frames that their Cartesian ports speak of."""

    def __init__(self, params: MotionParams) -> None:
        """Take the arms, where they stand and what the reference is."""
        arms = params.arms.driven
        self._bases: dict[CartArm, Vector] = {name: _base(name, params) for name in arms}
        self._seen = params.reference == "camera" and "ECM" in arms
        self.names: Mapping[CartArm, str] = {name: self._name(name) for name in arms}
        """Per arm the `frame_id` of what is not `local/`."""

    def _name(self, arm: CartArm) -> str:
        if not self._seen:
            return f"{arm}_base"
        return CART_FRAME if arm == "ECM" else CAMERA_FRAME

    def of(self, arm: CartArm, camera: Vector | None) -> Vector:
        """Return the pose of the arm's base frame in its reference, shape (4, 4); `camera` is the ECM's tip in `ECM_base`."""
        if not self._seen:
            return np.eye(4)
        if arm == "ECM" or camera is None:
            return self._bases[arm]
        return inverse_pose(self._bases["ECM"] @ camera) @ self._bases[arm]


def _base(arm: CartArm, params: MotionParams) -> Vector:
    """Return the pose of the arm's base frame in the world, shape (4, 4)."""
    if params.mounting == "cart":
        return setup_joints.base_pose(arm, np.array(getattr(params.setup_joints, arm) or setup_joints.SIMULATED[arm]))
    stands = params.arms.driven[arm]
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = rotation.matrix(np.array(stands.orientation)), stands.position
    return base
