"""A scene whose truth is drawn: its geometry, its state, and the cameras in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.model import place as place_arms
from engines.mujoco.model import spec
from engines.mujoco.pictures.camera_mount import CameraMount
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.surroundings import make_place
from engines.mujoco.pictures.variation import Variation
from engines.mujoco.place.part import PlacePart
from engines.mujoco.truth.id_buffer import IdBuffer
from engines.mujoco.truth.keypoints import InstrumentView, instruments
from engines.mujoco.truth.labels import Body, label_bodies, rigid_class
from engines.mujoco.truth.projection import Projection
from engines.mujoco.truth.scene_class import SceneClass, tissue_class
from engines.mujoco.truth.sight import Motion, Sight, Viewpoint
from engines.mujoco.truth.surfaces import Piece, Surfaces, rigid_piece, soft_piece, visible_geoms
from robots.dvrk.endoscope import EYES, Eye
from schemas.vectors import Vector

__all__ = ["Instant", "TruthScene"]

_SURROUNDINGS = "surroundings"


class Instant(NamedTuple):
    """Surfaces of the scene at an instant, and what each camera sees of them."""

    surfaces: Surfaces
    vertices: Vector
    sights: Mapping[Eye, Sight]


class TruthScene:
    """The geometry of the plain pictures; with endoscope looks, also the surroundings."""

    def __init__(
        self, params: EndoscopeParams, gl: str, bodies: Mapping[str, SoftBody] = MappingProxyType({})
    ) -> None:
        """Build the scene with the soft `bodies`; `gl`: the OpenGL to use, by its name in MUJOCO_GL."""
        self._params, self._soft = params, bodies
        self.model = spec(params).compile()
        self.data = mujoco.MjData(self.model)
        self._mount = CameraMount(params, self.model)
        place_arms(self.model, self.data, params.arms)
        mujoco.mj_kinematics(self.model, self.data)
        self._place = self._make_place()
        self._geoms = visible_geoms(self.model)
        owners = sorted({int(self.model.geom_bodyid[geom]) for geom in self._geoms})
        self._owners = {owner: number for number, owner in enumerate(owners, 1)}
        self.bodies = label_bodies(self._named(owners))
        """All bodies that pictures may show: rigid, then soft, then the surroundings."""
        self.rigid_count = len(owners)
        self.instruments = instruments(params, self.model)
        """Keypoints of all instruments."""
        self._versions: list[int] = []
        self._surfaces = self._renew()
        self.projection = Projection(params.camera, params.distortion)
        """The camera of either eye."""
        self._buffer = IdBuffer(gl, self.projection.drawn_size)

    def _make_place(self) -> list[PlacePart]:
        if self._params.looks != "endoscope":
            return []
        lens = self._mount.pose(self.data)[:3, 3]
        seed = Variation(self._params.randomise).place_seed
        return make_place(self._params, self.model, self._soft, lens, seed)

    def _named(self, owners: list[int]) -> Iterator[tuple[str, SceneClass]]:
        for owner in owners:
            name = self.model.body(owner).name
            yield name, rigid_class(self._params, name)
        looks = self._params.soft_bodies
        yield from ((name, tissue_class(looks[name].tissue(name))) for name in self._soft)
        if self._place:
            yield _SURROUNDINGS, SceneClass.SURROUNDINGS

    def _renew(self) -> Surfaces:
        """Return the triangles with the surfaces that soft bodies have now."""
        classes = {body.id: body.scene_class for body in self.bodies}
        pieces: list[Piece] = []
        for geom in self._geoms:
            number = self._owners[int(self.model.geom_bodyid[geom])]
            pieces.append(rigid_piece(self.model, self.data, geom, number, classes[number]))
        for number, soft in enumerate(self._soft.values(), len(self._owners) + 1):
            pieces.append(soft_piece(soft, number, classes[number]))
        pieces += [_static_piece(part, len(self.bodies)) for part in self._place]
        self._versions = [soft.version for soft in self._soft.values()]
        return Surfaces(pieces)

    def look(self, positions: Vector, eyes: tuple[Eye, ...] = EYES) -> Instant:
        """Return what the cameras see with joints at `positions`, shape (nq,), and soft bodies as now."""
        self.data.qpos[:] = positions
        mujoco.mj_kinematics(self.model, self.data)
        if self._versions != [soft.version for soft in self._soft.values()]:
            self._surfaces = self._renew()
        vertices = self._surfaces.vertices()
        return Instant(
            self._surfaces, vertices, {eye: self._see(self._surfaces, vertices, eye) for eye in eyes}
        )

    def motion(self, before: Instant, eye: Eye, now: Instant) -> Motion:
        """Return the motion of the points that `eye` saw, until `now`, the instant looked at last."""
        later = before.surfaces.vertices()
        sight = now.sights[eye]
        return before.sights[eye].motion(later, sight.view, sight)

    def instrument_views(self, sight: Sight) -> dict[str, InstrumentView]:
        """Return the instruments in the arms, by arm, as a camera sees them at the state looked at last."""
        return {
            one.arm: one.view(self.data, sight, self.bodies)
            for one in self.instruments
            if one.is_in_arm(self.data)
        }

    def view(self, eye: Eye) -> Viewpoint:
        """Return the camera of an eye at the state looked at last."""
        pose = self._mount.pose(self.data).copy()
        pose[:3, 3] += (-0.5 if eye == "left" else 0.5) * self._params.baseline * pose[:3, 0]
        return Viewpoint(pose, self.projection)

    def _see(self, surfaces: Surfaces, vertices: Vector, eye: Eye) -> Sight:
        view = self.view(eye)
        corners = view.to_camera(vertices)[surfaces.faces]
        drawn = self._buffer.draw(corners, self.projection.drawn_intrinsics, self._mount.clip)
        return Sight(surfaces, vertices, view, self.projection.pick(drawn))

    def silhouette(self, sight: Sight, body: Body) -> NDArray[np.bool_]:
        """Return the pixels, shape (height, width), that a body would have alone, at the last state."""
        own = self._surfaces.faces[self._surfaces.bodies == body.id]
        corners = sight.view.to_camera(self._surfaces.vertices())[own]
        drawn = self._buffer.draw(corners, self.projection.drawn_intrinsics, self._mount.clip)
        return self.projection.pick(drawn) >= 0

    def close(self) -> None:
        """Free the OpenGL context. May be called twice."""
        self._buffer.close()


def _static_piece(part: PlacePart, body: int) -> Piece:
    classes = np.full(len(part.faces), SceneClass.SURROUNDINGS, np.uint16)
    return Piece(body, part.faces, classes, lambda: part.vertices)
