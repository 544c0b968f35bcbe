"""The frames of an arm's Cartesian ports.

On the real system (jhu-dvrk/sawIntuitiveResearchKit) the base frame of a PSM in the camera's is inv(cart ->
camera) (cart -> RCM), both through the setup joints. Without setup joints a client sets where an arm stands.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from controllers.motion.params import Arms, MotionParams, SetupJoints
from robots.dvrk import crtk, mtm, setup_joints
from robots.dvrk.crtk import Mounting
from robots.dvrk.setup_joints import CartArm, DrivenArm
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = [
    "BaseFrame",
    "CartParams",
    "base_in_world",
    "reference_frame",
    "rotate_twist",
    "setup_positions",
]


class CartParams(Protocol):
    """Parameters with the arms of a cart."""

    @property
    def arms(self) -> Arms:
        """The arms."""
        ...

    @property
    def mounting(self) -> Mounting:
        """Whether setup joints carry the arms."""
        ...

    @property
    def setup_joints(self) -> SetupJoints:
        """Positions of the setup joints."""
        ...


def rotate_twist(rotation_matrix: Vector, vector: Vector) -> Vector:
    """Return a twist or wrench, shape (6,), with both parts rotated by a matrix of shape (3, 3)."""
    return np.concatenate([rotation_matrix @ vector[:3], rotation_matrix @ vector[3:]])


def setup_positions(arm: CartArm, params: CartParams) -> Vector:
    """Return the positions of the setup joints under `arm`, shape (6,)."""
    return np.array(getattr(params.setup_joints, arm) or setup_joints.SIMULATED[arm])


def base_in_world(arm: DrivenArm, params: CartParams) -> Vector:
    """Return the pose of the arm's base frame in the world by the scenario, shape (4, 4)."""
    if params.mounting == "cart" and arm != "MTML" and arm != "MTMR":
        return setup_joints.base_pose(arm, setup_positions(arm, params))
    return params.arms.driven_arms[arm].pose


def reference_frame(arm: DrivenArm, params: MotionParams) -> str:
    """Return the `frame_id` of the arm's Cartesian ports other than `local/`."""
    return crtk.reference_frame(arm, params.arms.present_arms, params.mounting, params.reference)


_ORIGIN = np.eye(4)


class BaseFrame:
    """The base frame of an arm in the reference frame of the arm's Cartesian ports."""

    def __init__(self, arm: DrivenArm, params: MotionParams, camera: Callable[[], Vector | None]) -> None:
        """Start at the scenario's pose.

        Args:
            arm: name of the arm.
            params: parameters of the controller.
            camera: returns the pose of the world in the frame of the ECM's tip, shape (4, 4), if there is an
                ECM; the same array until the ECM moves.
        """
        self.reference, self.local = reference_frame(arm, params), crtk.base_frame(arm)
        """`frame_id` of ports other than `local/`, and of `local/` ports."""
        self._camera, self._carried = camera, params.mounting == "cart" and arm in params.arms.present_arms
        self._world = base_in_world(arm, params)
        if self.reference == mtm.DISPLAY_FRAME and (arm == "MTML" or arm == "MTMR"):
            self._world = mtm.BASE[arm].copy()
        self._seen_by, self._in_camera = np.eye(4), np.eye(4)
        self.state = (self._world,)

    @property
    def pose(self) -> Vector:
        """Pose of the base frame in the reference, shape (4, 4)."""
        if self.reference == self.local:
            return _ORIGIN
        camera = self._camera() if self.reference == crtk.CAMERA_FRAME else None
        if camera is None:
            return self._world
        if camera is not self._seen_by:  # beside a camera no client sets where an arm stands
            self._seen_by, self._in_camera = camera, camera @ self._world
        return self._in_camera

    def place(self, base: Vector) -> None:
        """Let the base frame stand at `base`, shape (4, 4), in the world; the arm itself does not move."""
        self._world[:] = base

    def check_free(self) -> None:
        """Raise MotionError unless clients may set where the base frame stands."""
        if self._carried:
            raise MotionError(
                "the setup joints determine where the arm stands (`setup_joints` of the scenario)"
            )
        if self.reference != crtk.WORLD_FRAME:
            raise MotionError(
                f"poses of the arm are in frame '{self.reference}'; `reference: world` of the motion"
                " controller leaves its base frame to clients"
            )
