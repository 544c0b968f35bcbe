"""Liquid on a soft body as the physically based renderer draws it: a clear, shining coat over the faces."""

from __future__ import annotations

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.pictures.filament.upload import make_texture, vertex_layout, write_mesh
from hub.participant.view import tint_of
from schemas.soft_surface import FILM_STEP_M
from schemas.vectors import Vector

__all__ = ["DrawnFilm"]

_STEPS = 256
"""Thicknesses of a film, in `FILM_STEP_M`."""
_LEAST = 1.0
"""Least thickness that is drawn, in steps."""
_LIFT = 1.0e-4
"""Distance of the coat from the faces, m, so that it is not in them."""
_ROUGHNESS = 0.08


class DrawnFilm:
    """The liquid on one mesh of a soft body."""

    def __init__(
        self, context: mjrf.Context, scene: mjrf.Scene, liquid: str, faces: NDArray[np.uint32], vertices: int
    ) -> None:
        """Prepare a coat for `faces`, drawn vertices of shape (m, 3), of `vertices` in all."""
        self._scene, self._faces = scene, faces
        self._layout = vertex_layout(vertices, faces.size)
        self._mesh = context.create_mesh(self._layout)
        self._texture = make_texture(context, _coat_colours(liquid), mjrf.ColorSpace.COLORSPACE_SRGB)
        self._renderable = context.create_renderable(
            mjrf.RenderableParams(cast_shadow=False, receive_shadow=True)
        )
        self._is_shown = False

    def update(self, vertices: NDArray[np.float32], steps: Vector) -> None:
        """Show the liquid.

        Args:
            vertices: as drawn, with tangent frames, shape (n, 9).
            steps: thickness at each vertex, in `FILM_STEP_M`, shape (n,).
        """
        is_wet = np.asarray((steps[self._faces] >= _LEAST).any(axis=1))
        if not is_wet.any():
            self.hide()
            return
        # an upload has as many faces as its mesh: dry ones shrink to a point
        wet = self._faces * is_wet[:, None].astype(np.uint32)
        coat = vertices.copy()
        lift = np.float32(_LIFT) + np.float32(FILM_STEP_M) * steps.astype(np.float32)
        coat[:, :3] += lift[:, None] * _normals(vertices[:, 3:7])
        coat[:, 7], coat[:, 8] = (np.minimum(steps, _STEPS - 1) + 0.5) / _STEPS, 0.5
        write_mesh(self._mesh, self._layout, coat, wet)
        if not self._is_shown:
            self._renderable.set_mesh(self._mesh, 0, wet.size)
            self._renderable.set_material(
                mjrf.Material(
                    color=(1.0, 1.0, 1.0, 0.999),
                    metallic=0.0,
                    roughness=_ROUGHNESS,
                    color_texture=self._texture,
                )
            )
            self._scene.add_renderable(self._renderable)
            self._is_shown = True

    def hide(self) -> None:
        """Show no liquid."""
        if self._is_shown:
            self._scene.remove_renderable(self._renderable)
            self._is_shown = False


def _coat_colours(liquid: str) -> NDArray[np.uint8]:
    """Return colour and opacity over the thickness of a film, shape (1, 256, 4)."""
    tint = tint_of(liquid)
    through = np.exp(-FILM_STEP_M * np.arange(_STEPS)[:, None] / np.array(tint.depth_m))
    opacity = 1.0 - through.mean(axis=1)
    # the share of light that passes tints what is below
    passed = through / np.maximum(through.max(axis=1, keepdims=True), 1e-6)
    colours = np.column_stack([np.array(tint.deep) * (0.5 + 0.5 * passed), opacity])
    return np.rint(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8)[None]


def _normals(quaternions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the z axes, shape (n, 3), of quaternions (x, y, z, w), shape (n, 4)."""
    x, y, z, w = quaternions.T
    return np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
