"""All triangles of a scene, as the plain renderer draws them, moved by the scene's state.

Topology and state are apart: the triangles of one instant have vertices at another instant too, which is the
motion of each point of the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import acos, ceil, pi
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.solid_meshes import Triangles, solid_mesh
from engines.mujoco.truth.scene_class import LIQUIDS, SURFACES, SceneClass
from robots import rotation
from schemas.soft_surface import FILM_STEP_M
from schemas.vectors import Vector

__all__ = ["Piece", "Surfaces", "body_triangles", "rigid_piece", "soft_piece", "visible_geoms"]

_SHOWN_GROUPS = 3
"""Geoms of these first groups are drawn; collision shapes are in the next."""
_FLATNESS_M, _MOST_AROUND = 5e-6, 128
"""Farthest that a round solid's triangles are below its surface, m, unless it has that many corners around.
"""
_WET_M = 50e-6
"""A film is seen as a liquid from this thickness on, m: it lets a third of the green light through."""

Faces = NDArray[np.int64]


class Piece(NamedTuple):
    """Triangles of one body, which move together or by nodes."""

    body: int
    """Number of the body; see `labels.Body`."""
    faces: Faces
    """Vertex indices, shape (f, 3), counter-clockwise from outside."""
    classes: NDArray[np.uint16]
    """Class of each face, shape (f,)."""
    vertices: Callable[[], Vector]
    """Returns the vertices at the state of the scene now, shape (v, 3), m, frame `world`."""
    wet: Callable[[], Vector] | None = None
    """Returns the thickness of the film at the vertices, shape (v,), m."""
    liquid: SceneClass = SceneClass.BLOOD


class Surfaces:
    """The triangles of all pieces in one list."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._pieces = pieces
        counts = [len(piece.vertices()) for piece in pieces]
        starts = np.cumsum([0, *counts])
        self.faces: Faces = np.concatenate(
            [np.zeros((0, 3), np.int64)]
            + [piece.faces + start for piece, start in zip(pieces, starts, strict=False)]
        )
        """Vertex indices, shape (f, 3)."""
        none = np.zeros(0, np.uint16)
        self.bodies = np.concatenate(
            [none, *(np.full(len(piece.faces), piece.body, np.uint16) for piece in pieces)]
        )
        """Number of the body of each face, shape (f,)."""
        self.classes = np.concatenate([none, *(piece.classes for piece in pieces)])
        """Class of each face, shape (f,)."""

    def vertices(self) -> Vector:
        """Return the vertices now, shape (v, 3), m, frame `world`."""
        return np.concatenate([np.zeros((0, 3)), *(piece.vertices() for piece in self._pieces)])

    def wet_faces(self) -> tuple[Vector, NDArray[np.uint16]]:
        """Return thickness over the visible one at the corners of each face, (f, 3), and its liquid, (f,)."""
        thickness, liquid = np.zeros(self.faces.shape), np.zeros(len(self.faces), np.uint16)
        start = 0
        for piece in self._pieces:
            end = start + len(piece.faces)
            if piece.wet is not None:
                thickness[start:end] = piece.wet()[piece.faces] / _WET_M
                liquid[start:end] = piece.liquid
            start = end
        return thickness, liquid


def visible_geoms(model: mujoco.MjModel) -> list[int]:
    """Return the geoms that plain looks draw."""
    material = model.geom_matid
    opacity = np.where(
        material < 0, model.geom_rgba[:, 3], model.mat_rgba[material, 3] if model.nmat else 1.0
    )
    return np.flatnonzero((model.geom_group < _SHOWN_GROUPS) & (opacity > 0.0)).tolist()


def rigid_piece(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, body: int, scene_class: SceneClass
) -> Piece:
    """Return the triangles of a geom of the model, moved by `data`."""
    shape = _geom_triangles(model, geom)

    def vertices() -> Vector:
        return shape.vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]

    return Piece(body, shape.faces, np.full(len(shape.faces), scene_class, np.uint16), vertices)


def soft_piece(soft: SoftBody, body: int, scene_class: SceneClass) -> Piece:
    """Return the triangles of a soft body with the surface it has now, moved by its nodes."""
    if soft.version:
        surface = soft.surface
        present = np.flatnonzero(surface.faces[:, 0] >= 0)
        if not len(present):  # burnt away
            empty = Triangles(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
            return Piece(body, empty.faces, np.zeros(0, np.uint16), lambda: empty.vertices)
        kinds = surface.kinds[present]
        rest = soft.rest[surface.origins].astype(np.float64)
        mesh = SkinMesh(rest, surface.faces[present].astype(np.int64), kinds)
        classes = _kind_classes(scene_class)[kinds].repeat(len(mesh.faces) // len(kinds))
    else:
        mesh = SkinMesh(soft.rest.astype(np.float64), soft.triangles.astype(np.int64))
        classes = np.full(len(mesh.faces), scene_class, np.uint16)
    known = len(soft.nodes)

    def vertices() -> Vector:
        return mesh.vertices(soft.nodes[:known].astype(np.float64))

    def wet() -> Vector:
        return FILM_STEP_M * mesh.spread(soft.film[:known].astype(np.float64))

    liquid = LIQUIDS.get(soft.liquid, SceneClass.BLOOD)
    return Piece(body, mesh.faces, classes, vertices, wet if soft.may_be_wet else None, liquid)


def _kind_classes(outside: SceneClass) -> NDArray[np.uint16]:
    """Return the class of each kind of face."""
    classes = np.full(max(SURFACES) + 1, outside, np.uint16)
    for kind, scene_class in SURFACES.items():
        classes[kind] = scene_class
    return classes


def body_triangles(model: mujoco.MjModel, body: int, part: str = "") -> Triangles:
    """Return the triangles of a body's visible geoms in the body's frame, m.

    `part`: only of geoms or meshes whose names end so.
    """
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for geom in visible_geoms(model):
        if int(model.geom_bodyid[geom]) != body or not _geom_name(model, geom).endswith(part):
            continue
        shape, turn = _geom_triangles(model, geom), rotation.matrix(np.roll(model.geom_quat[geom], -1))
        vertices.append(shape.vertices @ turn.T + model.geom_pos[geom])
        faces.append(shape.faces + count)
        count += len(shape.vertices)
    return Triangles(np.concatenate(vertices), np.concatenate(faces))


def _geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom's mesh, or of the geom without mesh."""
    mesh = int(model.geom_dataid[geom])
    kind, number = (mujoco.mjtObj.mjOBJ_MESH, mesh) if mesh >= 0 else (mujoco.mjtObj.mjOBJ_GEOM, geom)
    return mujoco.mj_id2name(model, kind, number) or ""


def _geom_triangles(model: mujoco.MjModel, geom: int) -> Triangles:
    """Return the triangles of a geom in the geom's own frame."""
    mesh = int(model.geom_dataid[geom])
    if mesh < 0:
        size = model.geom_size[geom]
        # no ring at the equator: both ends of a capsule are half a sphere
        around = _corners_around(float(size.max()) if _is_ellipsoid(model, geom) else float(size[0]))
        return solid_mesh(mujoco.mjtGeom(int(model.geom_type[geom])), size, around, around // 2 | 1)
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    first, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return Triangles(
        model.mesh_vert[start : start + count].astype(np.float64),
        model.mesh_face[first : first + faces].astype(np.int64),
    )


def _is_ellipsoid(model: mujoco.MjModel, geom: int) -> bool:
    return int(model.geom_type[geom]) == mujoco.mjtGeom.mjGEOM_ELLIPSOID


def _corners_around(radius: float) -> int:
    """Return how many corners a circle needs, for `radius`, m."""
    return min(_MOST_AROUND, max(8, ceil(pi / acos(1.0 - min(1.0, _FLATNESS_M / max(radius, 1e-9))))))
