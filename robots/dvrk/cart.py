"""Frames of a whole patient cart: the base frames of the arms, and the view of the endoscope.

An arm's `local/measured_cp` is the pose of its tip in its own base frame `<arm>_base`. With setup joints and
an endoscope, `ECM/measured_cp` is the camera in the cart's frame, `SUJ/<arm>/local/measured_cp` an arm's base
in the cart's frame, `SUJ/<arm>/measured_cp` the same in the camera's frame, and `PSM1/measured_cp` the tip in
the camera's frame (jhu-dvrk/sawIntuitiveResearchKit, core/components/code/mtsIntuitiveResearchKitSUJ.cpp).
"""

from __future__ import annotations

from robots.dvrk.setup_joints import CartArm, base_pose
from robots.transform import inverse_transform
from schemas.vectors import Vector

__all__ = ["base_in_view", "camera_pose"]


def camera_pose(endoscope_tip: Vector, setup_positions: Vector) -> Vector:
    """Return the pose of the camera in the cart's frame, shape (4, 4).

    Args:
        endoscope_tip: pose of the camera in `ECM_base`, shape (4, 4): the ECM's `forward`.
        setup_positions: of the setup joint that carries the ECM, shape (6,).
    """
    return base_pose("ECM", setup_positions) @ endoscope_tip


def base_in_view(arm: CartArm, setup_positions: Vector, camera: Vector) -> Vector:
    """Return the pose of `<arm>_base` in the camera's frame, shape (4, 4).

    It takes setup joint positions, shape (6,), and `camera_pose`.
    """
    return inverse_transform(camera) @ base_pose(arm, setup_positions)
