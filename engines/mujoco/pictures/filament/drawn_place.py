"""A place as the physically based renderer draws it: meshes that stay as they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mujoco import mjrf

from engines.mujoco.pictures.filament.tangent_frames import TangentFrames
from engines.mujoco.pictures.filament.upload import Textures, vertex_layout, write_mesh
from engines.mujoco.pictures.variation import Variation
from engines.mujoco.place.part import PlacePart
from engines.mujoco.textures.noise import Noise
from engines.mujoco.textures.surface import Recipe, make_tile
from schemas.vectors import Vector

__all__ = ["DrawnPlace"]

_TILE_PIXELS = 512
_BEHIND = 0.5
"""Distance by which a part in layer 0 seems to be behind the scene, m, and four times as far in the next."""


class DrawnPlace:
    """The parts of a place in a scene."""

    def __init__(
        self,
        context: mjrf.Context,
        scene: mjrf.Scene,
        parts: Sequence[PlacePart],
        noise: Noise,
        variation: Variation,
        ahead: Vector | None,
    ) -> None:
        """Draw nearer layers first, if `ahead`, the direction of the camera at the start, is given.

        Pixels that a nearer surface hides later are drawn in vain: an eighth of a picture's time.
        """
        self._textures: dict[Recipe, Textures] = {}
        self._drawn: list[tuple[mjrf.Mesh, mjrf.Renderable]] = []
        for part in parts:
            if part.recipe not in self._textures:
                recipe = variation.recolour_place(part.recipe, len(self._textures))
                tile = make_tile(recipe, noise, part.tile, _TILE_PIXELS)
                self._textures[part.recipe] = Textures.of_maps(context, tile)
            behind = None if ahead is None else ahead * _BEHIND * 4.0**part.layer
            self._drawn.append(_add(context, scene, part, self._textures[part.recipe], behind))


def _add(
    context: mjrf.Context, scene: mjrf.Scene, part: PlacePart, textures: Textures, behind: Vector | None
) -> tuple[mjrf.Mesh, mjrf.Renderable]:
    frames = TangentFrames(part.faces, np.zeros(len(part.faces), np.int64))
    frames.set_uv(part.uv[frames.source])
    layout = vertex_layout(len(frames.source), frames.faces.size)
    mesh = context.create_mesh(layout)
    vertices = frames.vertices(part.vertices)
    write_mesh(context, mesh, layout, vertices, frames.faces.astype(np.uint32), behind)
    renderable = context.create_renderable(
        mjrf.RenderableParams(cast_shadow=False, receive_shadow=part.is_shaded)
    )
    renderable.set_mesh(mesh, 0, frames.faces.size)
    renderable.set_material(textures.material())
    scene.add_renderable(renderable)
    return mesh, renderable
