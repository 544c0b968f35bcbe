"""Markers as the physically based renderer draws them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mujoco import mjrf, mjtGeom

from engines.mujoco.markers.solids import Solid

__all__ = ["DrawnSolids"]

_ROUGHNESS = 0.6


class DrawnSolids:
    """Renderables for as many solids as have ever been shown at once."""

    def __init__(self, context: mjrf.Context, scene: mjrf.Scene) -> None:
        self._context, self._scene = context, scene
        self._pool: list[tuple[int, mjrf.Renderable]] = []
        self._shown = 0

    def show(self, solids: Sequence[Solid]) -> None:
        """Show `solids` and no others."""
        for _, renderable in self._pool[len(solids) : self._shown]:
            self._scene.remove_renderable(renderable)
        for place, solid in enumerate(solids):
            renderable = self._renderable(place, solid.type)
            renderable.set_pose(solid.position.astype(np.float32), solid.turn.astype(np.float32).ravel())
            renderable.set_size(solid.size.astype(np.float32))
            renderable.set_material(
                mjrf.Material(
                    color=solid.rgba, metallic=0.0, roughness=_ROUGHNESS, emissive=float(solid.emission)
                )
            )
        self._shown = len(solids)

    def _renderable(self, place: int, kind: int) -> mjrf.Renderable:
        """Return the renderable at a place of the pool, in the scene, with the mesh of a kind of geom."""
        if place == len(self._pool):
            params = mjrf.RenderableParams(cast_shadow=False, receive_shadow=False)
            self._pool.append((-1, self._context.create_renderable(params)))
        known, renderable = self._pool[place]
        if known != kind:
            renderable.set_geom_mesh(mjtGeom(kind), 16, 16, 1)
            self._pool[place] = kind, renderable
        if place >= self._shown:
            self._scene.add_renderable(renderable)
        return renderable
