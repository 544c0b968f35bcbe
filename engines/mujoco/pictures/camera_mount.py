"""Where the cameras of a scene are: at the tip of the ECM, or standing in the room."""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.pictures.endoscope_params import EndoscopeParams, ViewParams
from engines.mujoco.pictures.variation import Variation
from robots.dvrk.endoscope import FAR, optical_in_roll
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.transform import rigid_transform
from schemas.vectors import Vector

__all__ = ["CameraMount", "look_at"]


class CameraMount:
    """The optical frame midway between both cameras, and the distances between which they see."""

    def __init__(self, params: EndoscopeParams, model: mujoco.MjModel) -> None:
        """`model`: compiled from the scene of `params`."""
        ecm, far = params.arms.get("ECM"), params.far
        self._carrier = -1
        if params.view is not None:
            self._mounting = look_at(params.view)
        elif isinstance(ecm, MountedEcm):
            self._carrier, self._mounting = model.body("ECM/roll").id, optical_in_roll(ecm.endoscope)
            far = far or FAR
        else:
            self._mounting = look_at(_overview_camera(model))
        self._mounting = self._mounting @ Variation(params.randomise).mounting
        self.clip = (
            params.near,
            far or float(np.linalg.norm(self._mounting[:3, 3] - model.stat.center) + 2.0 * model.stat.extent),
        )
        """Near and far distance between which the cameras see, m."""

    def pose(self, data: mujoco.MjData) -> Vector:
        """Return the optical frame midway between the cameras, in the world, shape (4, 4)."""
        if self._carrier < 0:
            return self._mounting
        turn, position = data.xmat[self._carrier].reshape(3, 3), data.xpos[self._carrier]
        return rigid_transform(turn, position) @ self._mounting


def look_at(view: ViewParams) -> Vector:
    """Return the optical frame (x right, y down, z ahead) of cameras at `view`, shape (4, 4).

    They are upright unless they look along the vertical.
    """
    position, target = np.array(view.position), np.array(view.target)
    ahead = (target - position) / np.linalg.norm(target - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-9:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return rigid_transform(np.column_stack([right, np.cross(ahead, right), ahead]), position)


def _overview_camera(model: mujoco.MjModel) -> ViewParams:
    """Return the camera with which MuJoCo's viewer starts."""
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    azimuth, elevation = np.radians([camera.azimuth, camera.elevation])
    ahead = np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    x, y, z = camera.lookat - camera.distance * ahead
    return ViewParams(position=(x, y, z), target=tuple(camera.lookat))
