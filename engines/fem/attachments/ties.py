"""Ties of an attachment: nodes of one organ, and the nearest points of faces of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engines.fem.organ import Organ
from engines.fem.spheres import near_faces
from engines.tissue.meshing.tet_mesh import Indices
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["Ties", "find_ties"]


@dataclass(frozen=True)
class Ties:
    """Ties at rest."""

    elements: NDArray[np.int32]
    """Element of the first organ, in the order of its blocks, shape (t,)."""
    corners: NDArray[np.int32]
    """Corner of the element that is tied, shape (t,)."""
    own_slots: NDArray[np.int32]
    """A face of the first organ at this corner, by slot, shape (t,)."""
    slots: NDArray[np.int32]
    """Face of the second organ, by slot, shape (t,)."""
    shares: Vector
    """Shares of the nodes of this face in the tied point, the foot of the node on its plane, shape (t, 3)."""
    gaps: Vector
    """Distance of the node from the tied point along the normal of the face, m, shape (t,)."""
    areas: Vector
    """Tied area, m^2, shape (t,)."""


def find_ties(one: Organ, other: Organ, chosen: NDArray[np.bool_], within: float) -> Ties:
    """Return the ties of the nodes `chosen` of `one`, shape (n,), to faces of `other` nearer than `within`.

    A node has a third of the area of each face around it that is tied as a whole and looks at the other
    organ. Raises ValueError if there is none.
    """
    faces, nodes = one.mesh.triangles, one.mesh.nodes
    candidates = np.unique(faces)
    candidates = candidates[chosen[candidates]]
    slot = _nearest_faces(nodes[candidates], other, within)
    tied: NDArray[np.int64] = np.full(len(nodes), -1)
    tied[candidates] = np.where(slot >= 0, np.arange(len(candidates)), -1)
    whole = np.flatnonzero((tied[faces] >= 0).all(axis=1))
    normals, areas = _normals(nodes[faces[whole]])
    facing = _normals(other.mesh.nodes[other.mesh.triangles[slot[tied[faces[whole, 0]]]]])[0]
    towards = (normals * facing).sum(axis=1) < 0.0
    whole, areas = whole[towards], areas[towards]
    if not whole.size:
        raise ValueError(
            f"no face of '{one.name}' that looks at '{other.name}' is within {1e3 * within:.3g} mm of it:"
            " place the organs side by side, or state a larger `within`"
        )
    number: NDArray[np.int64] = tied[faces[whole]].ravel()
    kept, first = np.unique(number, return_index=True)
    slots = slot[kept]
    owners = one.solid.owners[whole[first // 3]]
    corners = (one.solid.tetrahedra[owners] == candidates[kept, None]).argmax(axis=1)
    shares, gaps = _feet(nodes[candidates[kept]], other.mesh.nodes[other.mesh.triangles[slots]])
    return Ties(
        elements=owners.astype(np.int32),
        corners=corners.astype(np.int32),
        own_slots=whole[first // 3].astype(np.int32),
        slots=slots.astype(np.int32),
        shares=shares,
        gaps=gaps,
        areas=np.bincount(number, np.repeat(areas / 3.0, 3))[kept].astype(np.float64),
    )


def _nearest_faces(points: Vector, other: Organ, within: float) -> Indices:
    """Return the slot of the nearest face of each point, -1 beyond `within`."""
    triangles = other.mesh.triangles
    slots: Indices = np.full(len(points), -1)
    near = near_faces(points, np.full(len(points), within), other.mesh.nodes, triangles)
    order = np.lexsort((near.distances, near.spheres))
    found, first = np.unique(near.spheres[order], return_index=True)
    best = order[first]
    number = {tuple(face): slot for slot, face in enumerate(triangles.tolist())}
    slots[found] = [number[tuple(face)] for face in near.faces[best].tolist()]
    return slots


def _normals(corners: Vector) -> tuple[Vector, Vector]:
    """Return unit normals and areas (m^2) of faces with `corners`, shape (f, 3, 3)."""
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(normals, axis=1)
    return normals / sizes[:, None], 0.5 * sizes


def _feet(points: Vector, corners: Vector) -> tuple[Vector, Vector]:
    """Return shares of the corners in the foot of each point on the plane of its face, and its distance, m.

    corners: shape (t, 3, 3). A foot beyond an edge has negative shares.
    """
    normals, areas = _normals(corners)
    away = points[:, None] - corners
    across = cross(np.roll(away, -1, axis=1), np.roll(away, 1, axis=1))
    shares = (across * normals[:, None]).sum(axis=2) / (2.0 * areas[:, None])
    return shares, (away[:, 0] * normals).sum(axis=1)
