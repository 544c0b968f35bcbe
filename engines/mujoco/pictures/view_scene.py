"""The scene of a page: the bodies of a MuJoCo model with their visible meshes, moved by `qpos` alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco import model
from engines.mujoco.params import MujocoParams
from engines.mujoco.pictures.solid_meshes import Triangles, solid_mesh
from engines.mujoco.place.dress import BRIGHT, SHINING
from hub.participant.view import Camera, Frame, Part, Rgb
from robots import rotation
from robots.dvrk.endoscope import BASELINE, FIELD_OF_VIEW, optical_in_roll
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from schemas.errors import MessageError
from schemas.vectors import Vector

__all__ = ["ViewScene"]

_SHOWN_GROUPS = 3
"""Geometries of these first groups are shown, as in MuJoCo's own viewer; collision shapes are in the next."""


class ViewScene:
    """The scene that a participant of kind mujoco simulates."""

    inputs = ("qpos",)
    surfaces: Mapping[str, Rgb] = {}

    def __init__(self, params: MujocoParams) -> None:
        scene = params.model_copy(update={"looks": "plain"})
        self._arms = scene.arms
        self._model = model.build(scene)
        self._data = mujoco.MjData(self._model)
        model.place(self._model, self._data, scene.arms)
        self.bodies = tuple(self._model.body(i).name or f"body{i}" for i in range(self._model.nbody))

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """The visible meshes, merged per body, colour and coat."""
        pieces: dict[tuple[int, tuple[float, ...], str], list[Triangles]] = {}
        for geom in self._visible_geoms():
            body = int(self._model.geom_bodyid[geom])
            pieces.setdefault((body, self._colour(geom), self._coat(geom)), []).append(self._triangles(geom))
        return tuple(
            _merge_triangles(body, colour, found)._replace(coat=coat)
            for (body, colour, coat), found in pieces.items()
        )

    @property
    def frames(self) -> tuple[Frame, ...]:
        """The base and the tip of each arm; of an arm with spares the tip of each instrument."""
        sites = (self._model.site(i) for i in range(self._model.nsite))
        return tuple(
            Frame(
                f"{site.name.partition('/')[0]}/{site.name.rpartition('/')[2]}",
                int(self._model.site_bodyid[site.id]),
                [*map(float, site.pos), *map(float, np.roll(site.quat, -1))],
            )
            for site in sites
            if site.name.rpartition("/")[2] in ("base", "tip")
        )

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The endoscope's, midway between its eyes."""
        ecm = self._arms.get("ECM")
        if not isinstance(ecm, MountedEcm):
            return ()
        pose = optical_in_roll(ecm.endoscope)
        placed = [*pose[:3, 3].tolist(), *rotation.from_matrix(pose[:3, :3]).tolist()]
        return (Camera("endoscope", self._model.body("ECM/roll").id, placed, FIELD_OF_VIEW, BASELINE),)

    def poses(self, values: Mapping[str, Vector]) -> NDArray[np.float32]:
        """Return the pose of each body in the world, shape (nbody, 7): m and quaternion (x, y, z, w)."""
        data, positions = self._data, values["qpos"]
        if positions.shape != data.qpos.shape:
            raise MessageError(
                f"qpos of {positions.size} numbers, but this scene has {data.qpos.size}: was it published by"
                " another version?"
            )
        data.qpos[:] = positions
        mujoco.mj_kinematics(self._model, data)
        return np.hstack([data.xpos, data.xquat[:, 1:], data.xquat[:, :1]]).astype(np.float32)

    def _visible_geoms(self) -> Iterator[int]:
        for geom in range(self._model.ngeom):
            if self._model.geom_group[geom] < _SHOWN_GROUPS and self._colour(geom)[3] > 0.0:
                yield geom

    def _colour(self, geom: int) -> tuple[float, float, float, float]:
        material = int(self._model.geom_matid[geom])
        rgba = self._model.geom_rgba[geom] if material < 0 else self._model.mat_rgba[material]
        red, green, blue, opacity = (round(float(value), 4) for value in rgba)
        return red, green, blue, opacity

    def _coat(self, geom: int) -> str:
        """Return the name of a geometry's material; '': without a name, or of plastic."""
        material = int(self._model.geom_matid[geom])
        if material >= 0:
            return self._model.material(material).name
        body = self._model.body(int(self._model.geom_bodyid[geom])).name
        return BRIGHT if body.startswith(SHINING) else ""

    def _triangles(self, geom: int) -> Triangles:
        """Return the triangles of a geometry in the frame of its body."""
        model_ = self._model
        mesh = int(model_.geom_dataid[geom])
        if mesh >= 0:
            start, count = int(model_.mesh_vertadr[mesh]), int(model_.mesh_vertnum[mesh])
            first, faces = int(model_.mesh_faceadr[mesh]), int(model_.mesh_facenum[mesh])
            found = Triangles(
                model_.mesh_vert[start : start + count].astype(np.float64),
                model_.mesh_face[first : first + faces].astype(np.int64),
            )
        else:
            found = solid_mesh(mujoco.mjtGeom(int(model_.geom_type[geom])), model_.geom_size[geom])
        turn = rotation.matrix(np.roll(model_.geom_quat[geom], -1))
        return Triangles(found.vertices @ turn.T + model_.geom_pos[geom], found.faces)


def _merge_triangles(body: int, colour: tuple[float, ...], pieces: list[Triangles]) -> Part:
    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    faces = [piece.faces + start for piece, start in zip(pieces, starts, strict=False)]
    red, green, blue, opacity = colour
    return Part(
        body,
        (red, green, blue, opacity),
        np.concatenate([piece.vertices for piece in pieces]).astype(np.float32),
        np.concatenate(faces).astype(np.uint32),
    )
