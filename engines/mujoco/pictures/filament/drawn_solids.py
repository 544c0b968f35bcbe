"""Markers as the physically based renderer draws them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mujoco import mjrf, mjtGeom

from engines.mujoco.markers.solids import Solid

__all__ = ["DrawnSolids"]

_ROUGHNESS = 0.6
_METAL, _METAL_ROUGHNESS = 0.5, 0.35
"""Share of metal of a blasted clip, which scatters light, and its roughness."""


class DrawnSolids:
    """Renderables for as many solids as have ever been shown at once."""

    def __init__(self, context: mjrf.Context, scene: mjrf.Scene) -> None:
        self._context, self._scene = context, scene
        self._pool: list[tuple[tuple[int, bool], mjrf.Renderable]] = []
        self._shown = 0

    def show(self, solids: Sequence[Solid]) -> None:
        """Show `solids` and no others."""
        for _, renderable in self._pool[len(solids) : self._shown]:
            self._scene.remove_renderable(renderable)
        for place, solid in enumerate(solids):
            renderable = self._renderable(place, solid)
            renderable.set_pose(solid.position.astype(np.float32), solid.turn.astype(np.float32).ravel())
            renderable.set_size(solid.size.astype(np.float32))
            renderable.set_material(_material(solid))
        self._shown = len(solids)

    def _renderable(self, place: int, solid: Solid) -> mjrf.Renderable:
        """Return the renderable at a place of the pool, in the scene, with the mesh of a solid."""
        wanted = solid.type, solid.is_metal
        if place < len(self._pool) and self._pool[place][0] != wanted and place < self._shown:
            self._scene.remove_renderable(self._pool[place][1])
        if place == len(self._pool) or self._pool[place][0] != wanted:
            params = mjrf.RenderableParams(cast_shadow=solid.is_metal, receive_shadow=solid.is_metal)
            renderable = self._context.create_renderable(params)
            renderable.set_geom_mesh(mjtGeom(solid.type), 16, 16, 1)
            self._pool[place : place + 1] = [(wanted, renderable)]
            self._scene.add_renderable(renderable)
        elif place >= self._shown:
            self._scene.add_renderable(self._pool[place][1])
        return self._pool[place][1]


def _material(solid: Solid) -> mjrf.Material:
    if solid.is_metal:
        return mjrf.Material(color=solid.rgba, metallic=_METAL, roughness=_METAL_ROUGHNESS)
    return mjrf.Material(color=solid.rgba, metallic=0.0, roughness=_ROUGHNESS, emissive=float(solid.emission))
