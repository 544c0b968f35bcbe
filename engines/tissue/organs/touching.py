"""Where two organs of one scan touch: the finer mesh is drawn onto the other; both get a surface there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.surface import Surface, bisect_long_edges
from engines.tissue.meshing.tet_mesh import TetMesh, shape_quality
from engines.tissue.organs.label_body import LabelBody
from engines.tissue.organs.label_mesh import LabelMesh
from engines.tissue.organs.picks import NodePick
from engines.tissue.organs.shape import ROUNDING_DIGITS
from schemas.vectors import Vector

__all__ = ["Contact", "join", "nearest_places"]

_REACHES = 1.75, 2.5, 3.5, 5.0
"""Distances of nodes that touch, in voxels: programs leave a seam of one; coarse meshes need more."""
_FAR = 0.5
"""Distance of a node from the other mesh, over its mean edge, beyond which they do not touch."""
_SEAM, _FEWEST = 1.25, 4
"""Distance of the voxels of organs that touch, in voxels; fewest faces of voxels."""
_STAIRS = 1.5
"""Area of the faces of voxels over that of the smooth surface, the mean of all directions."""
_ENOUGH = 0.7
"""Share of the area of voxels that touch, at which no farther nodes are taken."""
_FINENESS = 0.1
"""Steps to the other surface, in its mean edges."""
_DECAY = 0.15
"""Share of its neighbours' move that a node lacks: a move is gone after some three edges."""
_SWEEPS = 60
_FLATTEST, _LESS = 0.3, 0.9
"""Least shape quality after a move, and the factor of moves of nodes where it is worse."""
_MEETS = 0.2
"""Distance of nodes that are tied beyond the farthest, over the mean edge of the finer mesh."""
_MOST = 0.02
"""Largest distance of an attachment, m (engines/fem/attachments/params.py)."""


@dataclass(frozen=True)
class Contact:
    """Two organs that touch."""

    organs: tuple[str, str]
    """Names, that of the finer mesh first."""
    picks: tuple[NodePick, NodePick]
    """Nodes of each that touch the other."""
    within: float
    """Distance up to which nodes of the first are tied, m."""
    area: float
    """Area of the first that touches, m^2."""
    moved: float
    """Largest move of a node of the first, m."""


def join(meshes: dict[str, LabelMesh]) -> tuple[list[Contact], list[tuple[str, str]]]:
    """Return where organs touch, and pairs whose voxels touch, while their meshes are too coarse to.

    Nodes of the finer mesh of each pair move onto the other.

    Coarser pairs first, so that nothing moves after another has been drawn onto it.
    """
    edges = {name: mean_edge(made.mesh) for name, made in meshes.items()}
    order = sorted(meshes, key=lambda name: -edges[name])
    contacts, missed = list[Contact](), list[tuple[str, str]]()
    for i, first in enumerate(order):
        taken = np.zeros(len(meshes[first].mesh.nodes), np.bool_)
        areas = {name: _touching_area(meshes[first].body, meshes[name].body) for name in order[:i]}
        for second in sorted(areas, key=lambda name: -areas[name]):
            if not areas[second]:
                continue
            contact = _join_two(meshes, (first, second), areas[second], taken)
            if contact is None:
                missed.append((first, second))
            else:
                contacts.append(contact)
    return contacts, missed


def _join_two(
    meshes: dict[str, LabelMesh], names: tuple[str, str], area: float, taken: NDArray[np.bool_]
) -> Contact | None:
    """Draw the first organ onto the second. `taken`: nodes of the first that stay; more are added."""
    one, other = (meshes[name] for name in names)
    near = _near(one, other, area) & ~taken
    faces = one.mesh.triangles[near[one.mesh.triangles].all(axis=1)]
    if not len(faces):
        return None
    near &= np.isin(np.arange(len(near)), faces)
    aim = _nearest(one.mesh.nodes[near], other.mesh) - one.mesh.nodes[near]
    mesh = _draw(one.mesh, near, np.broadcast_to(aim.mean(axis=0), aim.shape), taken)  # as a whole
    targets = _nearest(mesh.nodes[near], other.mesh)
    mesh = _draw(mesh, near, targets - mesh.nodes[near], taken)
    meshes[names[0]] = replace(one, mesh=mesh)
    taken |= near
    facing = np.zeros(len(other.mesh.nodes), np.bool_)
    facing[other.mesh.triangles[_faces(targets, other.mesh)]] = True
    left = np.linalg.norm(mesh.nodes[near] - _nearest(mesh.nodes[near], other.mesh), axis=1)
    return Contact(
        names,
        (_pick(near), _pick(facing)),
        min(float(left.max()) + _MEETS * mean_edge(mesh), _MOST),
        float(np.linalg.norm(Surface(mesh.nodes, faces).area_vectors, axis=1).sum()),
        float(np.linalg.norm(mesh.nodes - one.mesh.nodes, axis=1).max()),
    )


def mean_edge(mesh: TetMesh) -> float:
    """Return the mean edge of the surface, m."""
    corners = mesh.nodes[mesh.triangles]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def _pick(nodes: NDArray[np.bool_]) -> NodePick:
    return NodePick(numbers=tuple(np.flatnonzero(nodes).tolist()))


def _near(one: LabelMesh, other: LabelMesh, area: float) -> NDArray[np.bool_]:
    """Return the nodes of a surface that touch another organ over some `area` (m^2), shape (n,)."""
    mesh, field = one.mesh, other.body.field
    skin = np.zeros(len(mesh.nodes), np.bool_)
    skin[mesh.triangles] = True
    distances = np.linalg.norm(mesh.nodes - _nearest(mesh.nodes, other.mesh), axis=1)
    depths = field(mesh.nodes) + other.offset + one.offset
    near = skin
    for reach in _REACHES:
        near = skin & (distances < max(reach * field.spacing, _FAR * mean_edge(other.mesh)))
        near &= depths > -reach * field.spacing
        faces = mesh.triangles[near[mesh.triangles].all(axis=1)]
        if np.linalg.norm(Surface(mesh.nodes, faces).area_vectors, axis=1).sum() > _ENOUGH * area:
            break
    return near


def _touching_area(one: LabelBody, other: LabelBody) -> float:
    """Return the area of the boundary of one body that touches another, m^2."""
    field = other.field
    count = int((field(one.boundary) > -_SEAM * field.spacing).sum())
    return count * one.field.spacing**2 / _STAIRS if count >= _FEWEST else 0.0


def nearest_places(points: Vector, mesh: TetMesh, step: float) -> Vector:
    """Return the places of a surface nearest to points, of places at most `step` (m) apart, shape (n, 3)."""
    tree: Any = import_module("scipy.spatial").cKDTree
    places = bisect_long_edges(Surface(mesh.nodes, mesh.triangles), step).middles
    found: Vector = places[tree(places).query(points)[1]]
    return found


def _nearest(points: Vector, mesh: TetMesh) -> Vector:
    """Return the nearest places of a surface, within a tenth of an edge, shape (n, 3)."""
    return nearest_places(points, mesh, _FINENESS * mean_edge(mesh))


def _faces(points: Vector, mesh: TetMesh) -> NDArray[np.int64]:
    """Return the faces of a surface nearest to points."""
    tree: Any = import_module("scipy.spatial").cKDTree
    return np.unique(tree(Surface(mesh.nodes, mesh.triangles).middles).query(points)[1])


def _draw(mesh: TetMesh, near: NDArray[np.bool_], aim: Vector, fixed: NDArray[np.bool_]) -> TetMesh:
    """Return the mesh with the nodes `near` moved by `aim` (m), others following, as far as its shape allows.

    `fixed`: nodes that stay, shape (n,).
    """
    pairs = mesh.tetrahedra[:, [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]].reshape(-1, 2)
    ends = np.unique(np.sort(pairs, axis=1), axis=0)
    ends = np.concatenate([ends, ends[:, ::-1]])
    count = np.bincount(ends[:, 0], minlength=len(mesh.nodes))[:, None]
    way = np.zeros_like(mesh.nodes)
    for _ in range(_SWEEPS):
        way[near], way[fixed] = aim, 0.0
        total = np.zeros_like(way)
        np.add.at(total, ends[:, 0], way[ends[:, 1]])
        way = total / count * (1.0 - _DECAY)
    way[near], way[fixed] = aim, 0.0
    share = np.ones((len(mesh.nodes), 1))
    for _ in range(_SWEEPS):
        moved: Vector = np.round(mesh.nodes + share * way, ROUNDING_DIGITS)
        flat = shape_quality(moved, mesh.tetrahedra) < _FLATTEST
        if not flat.any():
            return TetMesh(moved, mesh.tetrahedra)
        share[mesh.tetrahedra[flat]] *= _LESS
    return mesh
