"""The robot's metal and coats as the physically based renderer draws them: with textures, moved by poses."""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco import mjrf

from engines.mujoco.pictures.filament.tangent_frames import TangentFrames
from engines.mujoco.pictures.filament.upload import Textures, vertex_layout, write_mesh
from engines.mujoco.textures.atlas import SIDES, facing_side
from engines.mujoco.textures.coats import COATS
from engines.mujoco.textures.noise import Noise

__all__ = ["DrawnGeoms"]

_HIDDEN = 5
"""A group of geoms that MuJoCo does not draw."""


class DrawnGeoms:
    """Mesh geoms of a model that have a coat; the model's own renderables are hidden."""

    def __init__(self, context: mjrf.Context, scene: mjrf.Scene, model: mujoco.MjModel, noise: Noise) -> None:
        self._textures: dict[str, Textures] = {}
        self._drawn: list[tuple[int, mjrf.Mesh, mjrf.Renderable]] = []
        for geom in range(model.ngeom):
            material, mesh = int(model.geom_matid[geom]), int(model.geom_dataid[geom])
            name = model.material(material).name if material >= 0 else ""
            if name not in COATS or mesh < 0 or model.geom_group[geom] >= 3:
                continue
            if name not in self._textures:
                self._textures[name] = Textures.of_maps(context, COATS[name].maps(noise))
            renderable = context.create_renderable(
                mjrf.RenderableParams(cast_shadow=True, receive_shadow=True)
            )
            drawn = _upload(context, model, mesh, COATS[name].tile)
            renderable.set_mesh(drawn, 0, 3 * int(model.mesh_facenum[mesh]))
            renderable.set_material(self._textures[name].material(metallic=COATS[name].metal))
            scene.add_renderable(renderable)
            model.geom_group[geom] = _HIDDEN
            self._drawn.append((geom, drawn, renderable))

    def update(self, data: mujoco.MjData) -> None:
        """Move the geoms to where they are in `data`."""
        positions, turns = data.geom_xpos.astype(np.float32), data.geom_xmat.astype(np.float32)
        for geom, _, renderable in self._drawn:
            renderable.set_pose(positions[geom], turns[geom])


def _upload(context: mjrf.Context, model: mujoco.MjModel, mesh: int, tile: float) -> mjrf.Mesh:
    """Return a mesh of the model with texture coordinates in tiles, m: projected onto the sides of a box."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    start, faces_count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(np.float64)
    faces = model.mesh_face[start : start + faces_count].astype(np.int64)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    frames = TangentFrames(faces, facing_side(np.cross(b - a, c - a)))
    axes = SIDES[frames.chart, :2]
    frames.set_uv((np.einsum("nj,nij->ni", vertices[frames.source], axes) / tile).astype(np.float32))
    layout = vertex_layout(len(frames.source), frames.faces.size)
    drawn = context.create_mesh(layout)
    write_mesh(context, drawn, layout, frames.vertices(vertices), frames.faces.astype(np.uint32))
    return drawn
