"""Soft bodies of another engine in a MuJoCo scene: the state from their messages, and their skins.

MuJoCo draws a skin from `skin_vert` of its model, moved by bodies; bound to the world alone it is where the
vertices are. They and the normals are read again for every picture, without an upload beforehand
(docs/decisions/0017). The faces of a skin are fixed; the faces of a flex, and their materials, are read again
for every picture, so a body whose surface has changed is shown as a flex (docs/decisions/0126).
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from engines.mujoco.pictures.changed_skin import HIDDEN, SHOWN, ChangedSkin
from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.skin_params import SkinParams
from engines.mujoco.pictures.soft_body import SoftBody

__all__ = ["Skins"]

_SPECULAR, _SHININESS = 0.5, 0.7
"""Shine of wet tissue: small highlights. Chosen by eye."""


class Skins:
    """The skins of soft bodies in one model."""

    def __init__(
        self, scene: mujoco.MjSpec, bodies: Mapping[str, SoftBody], params: Mapping[str, SkinParams]
    ) -> None:
        """Add a skin per soft body, by name, to `scene`."""
        self._bodies = bodies
        self._meshes = {
            name: SkinMesh(body.rest.astype(np.float64), body.triangles.astype(np.int64))
            for name, body in bodies.items()
        }
        for name, mesh in self._meshes.items():
            vertices = mesh.vertices(bodies[name].rest.astype(np.float64))
            material = scene.add_material(
                name=f"{name}/skin",
                rgba=[*params[name].rgb(name), 1.0],
                specular=_SPECULAR,
                shininess=_SHININESS,
            )
            scene.add_skin(
                name=name,
                material=material.name,
                vert=vertices.ravel(),
                face=mesh.faces.ravel(),
                bodyname=["world"],
                bindpos=[0.0, 0.0, 0.0],
                bindquat=[1.0, 0.0, 0.0, 0.0],
                vertid=[list(range(len(vertices)))],
                vertweight=[[1.0] * len(vertices)],
            )
        self._changed = {
            name: ChangedSkin(scene, name, body, params[name].rgb(name))
            for name, body in bodies.items()
            if body.may_change
        }

    def show(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Move the skins in `model`, compiled from the scene, to where the nodes are now."""
        for name, mesh in self._meshes.items():
            skin = model.skin(name)
            is_changed = name in self._changed and self._changed[name].show(model, data)
            model.skin_group[skin.id] = HIDDEN if is_changed else SHOWN
            if is_changed:
                continue
            start, count = int(skin.vertadr[0]), int(skin.vertnum[0])
            model.skin_vert[start : start + count] = mesh.vertices(
                self._bodies[name].nodes.astype(np.float64)
            )
