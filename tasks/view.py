"""The endoscope's view: points inside the pyramid of either of the two cameras."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots.dvrk.ecm import tip
from robots.dvrk.endoscope import StereoCamera, optical_in_roll
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from schemas.vectors import Vector

__all__ = ["Frustum", "optical_in_tip"]


class Frustum:
    """The space in view of at least one of the two cameras."""

    def __init__(self, camera: StereoCamera, near: float, far: float) -> None:
        """`near`, `far`: range of the view ahead of `camera`, m."""
        tangent = 0.5 * camera.width / camera.focal_length
        self._tangents = np.array([tangent, tangent * camera.height / camera.width])
        self._half = 0.5 * camera.baseline
        self._near, self._far = near, far

    def sees(self, optical: Vector, points: Vector) -> NDArray[np.bool_]:
        """Return whether points, m, shape (n, 3), are in view, shape (n,).

        `optical` is the frame midway between the cameras (x right, y down, z ahead), shape (4, 4), in the
        frame of the points.
        """
        local = (points - optical[:3, 3]) @ optical[:3, :3]
        x, y, depth = local.T
        # a camera beside the middle sees a point as the middle sees it when shifted the other way
        sideways = np.abs(x) - self._half
        seen = (sideways <= self._tangents[0] * depth) & (np.abs(y) <= self._tangents[1] * depth)
        return seen & (depth >= self._near) & (depth <= self._far)


def optical_in_tip(ecm: MountedEcm) -> Vector:
    """Return the optical frame midway between the cameras in the frame of `ECM/measured_cp`, shape (4, 4)."""
    return np.linalg.inv(tip(ecm.endoscope, ecm.tip_frame)) @ optical_in_roll(ecm.endoscope)
