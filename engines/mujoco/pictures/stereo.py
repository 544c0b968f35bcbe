"""Draws what two cameras side by side see of a MuJoCo model, in one pass."""

from __future__ import annotations

from collections.abc import Sequence
from math import tan
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.markers.solids import Solid
from engines.mujoco.pictures import opengl
from robots.dvrk.endoscope import StereoCamera
from schemas.vectors import Vector

__all__ = ["StereoRenderer"]

_NO_SHADOWS = (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION)
_SHADOW_PIXELS = 2048
"""Side of the shadow map. MuJoCo's own 8192 takes three times as long to fill without a GPU and shows no more
at endoscope resolution.
"""
_SPARE_GEOMS = 100
"""Room in the scene for what MuJoCo may add to a model's geoms, beside soft bodies."""
_FLEX_GEOMS = 4
"""Geoms of a flex in the scene at most: vertices, edges, faces and skin (mjv_addGeoms)."""
_HIDDEN = 5
"""The last group of geoms (mjNGROUP is 6), which MuJoCo does not draw by default (mjv_defaultOption)."""


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
        self._shadows = shadows
        self._counts = model.flex_elemnum, model.flex_vertnum, model.flex_edgenum, model.flex_shellnum
        self._flex_room = [count.copy() for count in self._counts]
        """Counts of the compiled model, as many as a flex may have later."""
        self._room = model.ngeom + model.nskin + _FLEX_GEOMS * model.nflex + _SPARE_GEOMS
        self._scene = self._new_scene(self._room)
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.zeros((height, width, 3), np.uint8)
        half = clip[0] * tan(0.5 * camera.field_of_view)
        self._frustum = (half * camera.height / camera.width, *clip)
        slopes = np.array([half, self._frustum[0]]) / clip[0]  # (2,): tangents of the angles to the sides
        self._slopes, self._from_sides = slopes, 1.0 / np.hypot(1.0, slopes)
        self._groups = model.geom_group.copy()
        self._reaches = np.where(model.geom_rbound > 0.0, model.geom_rbound, np.inf)  # 0: a plane

    def _new_scene(self, room: int) -> mujoco.MjvScene:
        """Return a scene for both eyes, with room for as many geoms, and for all that a flex may have."""
        present = [count.copy() for count in self._counts]
        for count, most in zip(self._counts, self._flex_room, strict=True):
            count[:] = most
        scene = mujoco.MjvScene(self._model, room)
        for count, now in zip(self._counts, present, strict=True):
            count[:] = now
        scene.stereo = mujoco.mjtStereo.mjSTEREO_SIDEBYSIDE
        for flag in _NO_SHADOWS:
            scene.flags[flag] = self._shadows
        return scene

    def render(
        self, data: mujoco.MjData, pose: Vector, solids: Sequence[Solid] = ()
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the pictures of the left and the right camera, each of shape (height, width, 3), RGB.

        The first row is the top.

        Args:
            data: state whose kinematics are up to date.
            pose: the optical frame midway between the cameras, in the world, shape (4, 4).
            solids: to be drawn beside the model.
        """
        self._gl.make_current()
        if (room := self._room + len(solids)) > self._scene.maxgeom:
            self._scene = self._new_scene(2 * room)
        self._model.geom_group[:] = np.where(self._in_sight(data, pose), self._groups, _HIDDEN)
        what = mujoco.mjtCatBit.mjCAT_STATIC | mujoco.mjtCatBit.mjCAT_DYNAMIC
        mujoco.mjv_updateScene(self._model, data, self._options, None, self._anywhere, what, self._scene)
        _add(self._scene, solids)
        self._aim_cameras(pose)
        mujoco.mjr_render(self._viewport, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._viewport, self._context)
        width, upright = self._camera.width, self._pixels[::-1]
        return np.ascontiguousarray(upright[:, :width]), np.ascontiguousarray(upright[:, width:])

    def _in_sight(self, data: mujoco.MjData, pose: Vector) -> NDArray[np.bool_]:
        """Return which geoms, shape (ngeom,), reach into what one of the cameras sees, by their spheres.

        Nothing of the others would be in a picture: they need not be given to OpenGL.
        """
        centres = (data.geom_xpos - pose[:3, 3]) @ pose[:3, :3]  # (ngeom, 3), in the optical frame
        ahead, reach = centres[:, 2], self._reaches
        aside = np.abs(centres[:, :2]) - ahead[:, None] * self._slopes  # (ngeom, 2)
        aside[:, 0] -= 0.5 * self._camera.baseline
        _, near, far = self._frustum
        in_depth = (ahead + reach > near) & (ahead - reach < far)
        return in_depth & (aside * self._from_sides < reach[:, None]).all(axis=1)

    def _aim_cameras(self, pose: Vector) -> None:
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


def _add(scene: mujoco.MjvScene, solids: Sequence[Solid]) -> None:
    start, unset = scene.ngeom, np.zeros(3)
    for geom, solid in zip(scene.geoms[start : start + len(solids)], solids, strict=True):
        mujoco.mjv_initGeom(geom, solid.type, unset, solid.position, solid.turn.ravel(), solid.rgba)
        # extents, where `mjv_initGeom` takes radius and half length
        geom.size, geom.emission, geom.specular = solid.size, solid.emission, 0.0
    scene.ngeom = start + len(solids)
