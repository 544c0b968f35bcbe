"""Draws what two cameras side by side see of a MuJoCo model, in one pass."""

from __future__ import annotations

from math import tan
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from robots.dvrk.endoscope import StereoCamera
from schemas.vectors import Vector

__all__ = ["StereoRenderer"]

_NO_SHADOWS = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)
_SHADOW_PIXELS = 2048
"""Of the shadow map's side. MuJoCo's own 8192 takes three times as long to fill without a GPU and shows no
more at endoscope resolution.
"""
_SPARE_GEOMS = 100
"""Room in the scene for what MuJoCo may add to a model's geoms."""


class StereoRenderer:
    """Owns an OpenGL context, which belongs to the thread that made it, and draws `model` in it."""

    def __init__(
        self,
        model: mujoco.MjModel,
        camera: StereoCamera,
        clip: tuple[float, float],
        gl: str,
        *,
        shadows: bool,
    ) -> None:
        """Prepare to draw.

        Args:
            model: what to draw; its offscreen size and quality are set here, so no other renderer may use it.
            camera: the two cameras.
            clip: near and far distance between which they see, m.
            gl: the OpenGL to use, by its name in MUJOCO_GL.
            shadows: draw shadows and reflections.
        """
        self._model, self._camera = model, camera
        width, height = 2 * camera.width, camera.height
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.quality.offsamples = 0
        model.vis.quality.shadowsize = _SHADOW_PIXELS if shadows else 0
        self._gl: Any = opengl.context(gl, width, height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._options, self._anywhere = mujoco.MjvOption(), mujoco.MjvCamera()
        self._options.sitegroup[:] = 0
        self._scene = mujoco.MjvScene(model, model.ngeom + _SPARE_GEOMS)
        self._scene.stereo = mujoco.mjtStereo.mjSTEREO_SIDEBYSIDE
        for flag in _NO_SHADOWS:
            self._scene.flags[flag] = shadows
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.zeros((height, width, 3), np.uint8)
        half = clip[0] * tan(0.5 * camera.field_of_view)
        self._frustum = (half * camera.height / camera.width, *clip)

    def render(self, data: mujoco.MjData, pose: Vector) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the pictures of the left and the right camera, each of shape (height, width, 3), RGB.

        The first row is the top.

        Args:
            data: state whose kinematics are up to date.
            pose: the optical frame midway between the cameras, in the world, shape (4, 4).
        """
        self._gl.make_current()
        what = mujoco.mjtCatBit.mjCAT_STATIC | mujoco.mjtCatBit.mjCAT_DYNAMIC
        mujoco.mjv_updateScene(self._model, data, self._options, None, self._anywhere, what, self._scene)
        self._aim(pose)
        mujoco.mjr_render(self._viewport, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._viewport, self._context)
        width, upright = self._camera.width, self._pixels[::-1]
        return np.ascontiguousarray(upright[:, :width]), np.ascontiguousarray(upright[:, width:])

    def _aim(self, pose: Vector) -> None:
        right, down, ahead, middle = pose[:3, :4].T
        top, near, far = self._frustum
        for eye, side in zip(self._scene.camera, (-0.5, 0.5), strict=True):
            eye.pos, eye.forward, eye.up = middle + side * self._camera.baseline * right, ahead, -down
            eye.frustum_center, eye.frustum_bottom, eye.frustum_top = 0.0, -top, top
            eye.frustum_near, eye.frustum_far, eye.orthographic = near, far, 0
        lamp = self._scene.lights[0]
        if lamp.headlight:  # MuJoCo has put it where its own camera is
            lamp.pos, lamp.dir = middle, ahead

    def close(self) -> None:
        """Free the OpenGL context. May be called twice."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None
