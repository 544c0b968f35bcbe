"""Draws the number of the nearest triangle in each pixel, with the OpenGL that draws plain looks.

Each triangle has its number as its colour, without light, smoothing or textures: every OpenGL since 1.1 does
that exactly. Depth, normals and motion are computed from the triangle afterwards, not read from OpenGL.
"""

from __future__ import annotations

from ctypes import c_void_p
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from schemas.errors import TrocarError
from schemas.vectors import Vector

__all__ = ["IdBuffer"]


class IdBuffer:
    """An OpenGL context of its own, which belongs to the thread that made it."""

    def __init__(self, gl: str, size: tuple[int, int]) -> None:
        """`gl`: the OpenGL to use, by its name in MUJOCO_GL; `size`: width and height, pixels."""
        self._width, self._height = size
        self._context: Any = opengl.context(gl, *size)
        self._context.make_current()
        self._gl: Any = import_module("OpenGL.GL")
        # PyOpenGL's own forms look for the context with the window system that it was first imported for
        self._raw: Any = import_module("OpenGL.raw.GL.VERSION.GL_1_1")
        self._make_target()

    def _make_target(self) -> None:
        gl, size = self._gl, (self._width, self._height)
        self._target = gl.glGenFramebuffers(1)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._target)
        for form, attachment in (
            (gl.GL_RGBA8, gl.GL_COLOR_ATTACHMENT0),
            (gl.GL_DEPTH_COMPONENT24, gl.GL_DEPTH_ATTACHMENT),
        ):
            buffer = gl.glGenRenderbuffers(1)
            gl.glBindRenderbuffer(gl.GL_RENDERBUFFER, buffer)
            gl.glRenderbufferStorage(gl.GL_RENDERBUFFER, form, *size)
            gl.glFramebufferRenderbuffer(gl.GL_FRAMEBUFFER, attachment, gl.GL_RENDERBUFFER, buffer)
        if gl.glCheckFramebufferStatus(gl.GL_FRAMEBUFFER) != gl.GL_FRAMEBUFFER_COMPLETE:
            raise TrocarError(f"this OpenGL has no picture of {size[0]} x {size[1]} pixels with depth")
        gl.glViewport(0, 0, *size)
        for switch in (gl.GL_DITHER, gl.GL_BLEND, gl.GL_LIGHTING, gl.GL_TEXTURE_2D, gl.GL_MULTISAMPLE):
            gl.glDisable(switch)
        gl.glEnable(gl.GL_DEPTH_TEST)
        gl.glEnable(gl.GL_CULL_FACE)
        gl.glFrontFace(gl.GL_CW)  # rows run downwards, so the picture is a mirror image for OpenGL
        gl.glShadeModel(gl.GL_FLAT)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)

    def draw(self, corners: Vector, intrinsics: Vector, clip: tuple[float, float]) -> NDArray[np.int64]:
        """Return the number of the nearest triangle in each pixel, shape (height, width); -1: none.

        Args:
            corners: of the triangles, counter-clockwise from the visible side, in the camera's optical frame,
                shape (f, 3, 3), m.
            intrinsics: camera matrix K, shape (3, 3); pixel (0, 0) is the middle of the upper left pixel.
            clip: near and far distance between which the camera sees, m.
        """
        gl = self._gl
        self._context.make_current()
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._target)
        gl.glClearColor(0.0, 0.0, 0.0, 0.0)
        gl.glClear(gl.GL_COLOR_BUFFER_BIT | gl.GL_DEPTH_BUFFER_BIT)
        gl.glMatrixMode(gl.GL_PROJECTION)
        gl.glLoadMatrixd(np.ascontiguousarray(self._projection(intrinsics, clip).T))
        gl.glMatrixMode(gl.GL_MODELVIEW)
        gl.glLoadIdentity()
        positions = np.ascontiguousarray(corners, np.float32)
        numbers = np.arange(1, len(corners) + 1, dtype="<u4").repeat(3).view(np.uint8)
        gl.glEnableClientState(gl.GL_VERTEX_ARRAY)
        gl.glEnableClientState(gl.GL_COLOR_ARRAY)
        self._raw.glVertexPointer(3, gl.GL_FLOAT, 0, positions.ctypes.data_as(c_void_p))
        self._raw.glColorPointer(4, gl.GL_UNSIGNED_BYTE, 0, numbers.ctypes.data_as(c_void_p))
        gl.glDrawArrays(gl.GL_TRIANGLES, 0, 3 * len(corners))
        pixels = gl.glReadPixels(0, 0, self._width, self._height, gl.GL_RGBA, gl.GL_UNSIGNED_BYTE)
        found = np.frombuffer(pixels, "<u4").reshape(self._height, self._width)
        return found.astype(np.int64) - 1

    def _projection(self, intrinsics: Vector, clip: tuple[float, float]) -> Vector:
        """Return the matrix, shape (4, 4), from the optical frame to OpenGL's clip coordinates."""
        near, far = clip
        width, height = self._width, self._height
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[0, 2] = (
            2.0 * intrinsics[0, 0] / width,
            (2.0 * intrinsics[0, 2] + 1.0) / width - 1.0,
        )
        matrix[1, 1], matrix[1, 2] = (
            2.0 * intrinsics[1, 1] / height,
            (2.0 * intrinsics[1, 2] + 1.0) / height - 1.0,
        )
        matrix[2, 2], matrix[2, 3] = (far + near) / (far - near), -2.0 * far * near / (far - near)
        matrix[3, 2] = 1.0
        return matrix

    def close(self) -> None:
        """Free the OpenGL context. May be called twice."""
        if self._context is not None:
            self._context.make_current()
            self._context.free()
            self._context = None
