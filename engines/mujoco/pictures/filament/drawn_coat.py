"""A clear coat over the faces of a soft body: liquid, or the edge of a burn."""

from __future__ import annotations

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.pictures.filament.upload import make_texture, vertex_layout, write_mesh
from engines.mujoco.textures.surface import Pixels

__all__ = ["DrawnCoat"]


class DrawnCoat:
    """A coat on one mesh, with a texture of colours and opacities."""

    def __init__(
        self,
        context: mjrf.Context,
        scene: mjrf.Scene,
        faces: NDArray[np.uint32],
        texture: Pixels,
        roughness: float,
    ) -> None:
        """Prepare a coat for `faces`, drawn vertices of shape (m, 3)."""
        self._context, self._scene, self._faces, self._roughness = context, scene, faces, roughness
        self._layout = vertex_layout(int(faces.max()) + 1, faces.size)
        self._mesh = context.create_mesh(self._layout)
        self._texture = make_texture(context, texture, mjrf.ColorSpace.COLORSPACE_SRGB)
        self._renderable = context.create_renderable(
            mjrf.RenderableParams(cast_shadow=False, receive_shadow=True)
        )
        self._is_shown = False

    def show(
        self,
        vertices: NDArray[np.float32],
        uv: NDArray[np.float32],
        lift: NDArray[np.float32],
        is_coated: NDArray[np.bool_],
    ) -> None:
        """Show the coat.

        Args:
            vertices: as drawn, with tangent frames, shape (n, 9).
            uv: places in the texture, shape (n, 2).
            lift: distance from the faces, m, shape (n,).
            is_coated: which faces have a coat, shape (m,).
        """
        if not is_coated.any():
            self.hide()
            return
        coat = vertices.copy()
        coat[:, :3] += lift[:, None] * _normals(vertices[:, 3:7])
        coat[:, 7:] = uv
        # an upload has as many faces as its mesh: bare ones shrink to a point
        faces = self._faces * is_coated[:, None].astype(np.uint32)
        write_mesh(self._context, self._mesh, self._layout, coat, faces)
        if not self._is_shown:
            self._renderable.set_mesh(self._mesh, 0, self._faces.size)
            self._renderable.set_material(
                mjrf.Material(
                    color=(1.0, 1.0, 1.0, 0.999),
                    metallic=0.0,
                    roughness=self._roughness,
                    color_texture=self._texture,
                )
            )
            self._scene.add_renderable(self._renderable)
            self._is_shown = True

    def hide(self) -> None:
        """Show no coat."""
        if self._is_shown:
            self._scene.remove_renderable(self._renderable)
            self._is_shown = False


def _normals(quaternions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the z axes, shape (n, 3), of quaternions (x, y, z, w), shape (n, 4)."""
    x, y, z, w = quaternions.T
    return np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
