"""The inner wall of a tubular mesh: rings of nodes around its lumen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["InnerWall", "wall_along", "wall_around", "wall_of_rings"]

_LOOKS_IN = 0.5
"""Cosine of the largest angle between the normal of the inner wall and the way to the centre line."""
_CELL = 1.3
"""Distance of rings and sectors over the mean edge of the inner wall: an edge joins neighbours."""

_WIDEST_GAP = 2.0
"""Largest angle around the line without a node of the inner wall, rad."""
_NO_WALL = (
    "the mesh has no inner wall around the line of its lumen: a lumen needs a hollow mesh, and a line in the"
    " middle of the hollow, in the organ's own frame"
)


@dataclass(frozen=True)
class InnerWall:
    """Nodes of the inner wall by ring, from the left end to the right, and by sector around the tube."""

    rings: Indices
    """A node for each ring and sector, shape (r, a); a is even."""
    ring_of: Indices
    """Ring of each node of the mesh; -1: not on the inner wall, shape (n,)."""
    sector_of: Indices
    """Sector of each node, shape (n,)."""
    stations: Vector
    """Place of each node along the tube, from its left end, m, shape (n,)."""
    diameters: Vector
    """Outer diameter at each ring, m, shape (r,)."""


def wall_of_rings(mesh: TetMesh, rings: Indices, diameter: float) -> InnerWall:
    """Return the inner wall of a straight tube whose nodes are known, shape (r, a)."""
    middles = mesh.nodes[rings].mean(axis=1)
    way: Vector = middles[-1] - middles[0]
    stations: Vector = (mesh.nodes * (way / np.linalg.norm(way))).sum(axis=1)
    return wall_along(mesh, rings, stations, np.full(len(rings), diameter))


def wall_along(mesh: TetMesh, rings: Indices, stations: Vector, diameters: Vector) -> InnerWall:
    """Return the inner wall of a tube whose nodes and their places along it are known."""
    r, a = np.indices(rings.shape)
    ring_of, sector_of = (np.full(len(mesh.nodes), -1) for _ in range(2))
    ring_of[rings], sector_of[rings] = r, a
    return InnerWall(rings, ring_of, sector_of, stations, diameters)


def wall_around(mesh: TetMesh, line: Vector) -> InnerWall:
    """Return the inner wall around a centre line, points (m) of shape (k, 3), from the left end to the right.

    Raises ValueError where the mesh has no inner wall around the line.
    """
    stations, arms, tangents = _along(line, mesh.nodes)
    radii = np.linalg.norm(arms, axis=1)
    outward = arms / np.maximum(radii, 1e-12)[:, None]
    looks = (_normals(mesh) * outward).sum(axis=1)
    inner = np.flatnonzero(looks < -_LOOKS_IN)
    edge = _mean_edge(mesh, inner)
    if not np.isfinite(edge):
        raise ValueError(_NO_WALL)
    first, last = float(stations[inner].min()), float(stations[inner].max())
    count = max(3, round((last - first) / (_CELL * edge)) + 1)
    around = max(6, 2 * round(np.pi * float(np.median(radii[inner])) / (_CELL * edge)))
    ring_of, sector_of = (np.full(len(mesh.nodes), -1) for _ in range(2))
    spacing = (last - first) / (count - 1)
    ring_of[inner] = np.rint((stations[inner] - first) / spacing)
    angles = _angles(line, stations[inner], arms[inner], tangents[inner])
    if np.diff(np.sort(angles), append=angles.min() + 2.0 * np.pi).max() > _WIDEST_GAP:
        raise ValueError(_NO_WALL)
    sector_of[inner] = np.rint(angles * around / (2.0 * np.pi)).astype(np.int64) % around
    places: Vector = first + spacing * np.arange(count, dtype=np.float64)
    rings = _representatives(inner, stations, angles, places, around, spacing)
    outer = np.flatnonzero(looks > _LOOKS_IN)
    near = np.abs(stations[outer] - places[:, None])
    nearest = np.argsort(near, axis=1)[:, :around]
    return InnerWall(rings, ring_of, sector_of, stations, 2.0 * radii[outer][nearest].mean(axis=1))


def _along(line: Vector, points: Vector) -> tuple[Vector, Vector, Vector]:
    """Return arc length, arm and tangent of the nearest place of a line for each point.

    Shapes (n,), (n, 3) and (n, 3). The line goes on straight beyond its ends.
    """
    ways = np.diff(line, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    tangents = ways / lengths[:, None]
    begins = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    off = points[:, None] - line[:-1]  # (n, k, 3)
    along = (off * tangents).sum(axis=2)
    low, high = np.zeros(len(ways)), lengths.copy()
    low[0], high[-1] = -np.inf, np.inf
    along = np.minimum(np.maximum(along, low), high)
    arms = off - along[:, :, None] * tangents
    best = np.linalg.norm(arms, axis=2).argmin(axis=1)
    rows = np.arange(len(points))
    return begins[best] + along[rows, best], arms[rows, best], tangents[best]


def _angles(line: Vector, stations: Vector, arms: Vector, tangents: Vector) -> Vector:
    """Return the angle (rad, 0 to 2 pi) of each arm about the line, in a frame that does not twist."""
    ways = np.diff(line, axis=0)
    directions = ways / np.linalg.norm(ways, axis=1)[:, None]
    side = cross(directions[0], np.eye(3)[np.abs(directions[0]).argmin()])
    sides = [side / np.linalg.norm(side)]
    for direction in directions[1:]:
        side = sides[-1] - float((sides[-1] * direction).sum()) * direction
        sides.append(side / np.linalg.norm(side))
    begins = np.concatenate([[0.0], np.cumsum(np.linalg.norm(ways, axis=1))[:-1]])
    part = np.clip(np.searchsorted(begins, stations, side="right") - 1, 0, len(ways) - 1)
    first = np.array(sides)[part]
    second = cross(tangents, first)
    angles: Vector = np.arctan2((arms * second).sum(axis=1), (arms * first).sum(axis=1))
    return angles % (2.0 * np.pi)


def _representatives(
    inner: Indices, stations: Vector, angles: Vector, places: Vector, around: int, spacing: float
) -> Indices:
    """Return the node of the inner wall nearest to each place along the tube and sector, shape (r, a)."""
    sectors = 2.0 * np.pi / around * np.arange(around)
    turned = np.abs(angles[:, None] - sectors)
    turned = np.minimum(turned, 2.0 * np.pi - turned) * around / (2.0 * np.pi)  # (i, a), in sectors
    off = (stations[inner, None] - places) / spacing  # (i, r)
    return inner[(off[:, :, None] ** 2 + turned[:, None] ** 2).argmin(axis=0)]


def _normals(mesh: TetMesh) -> Vector:
    """Return the outward unit normal at each node of the surface, 0 elsewhere, shape (n, 3)."""
    corners = mesh.nodes[mesh.triangles]
    spans = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals: Vector = np.zeros((len(mesh.nodes), 3))
    for i in range(3):
        np.add.at(normals, mesh.triangles[:, i], spans)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def _mean_edge(mesh: TetMesh, nodes: Indices) -> float:
    """Return the mean edge of the faces between these nodes, m; not finite: there are none."""
    chosen: NDArray[np.bool_] = np.zeros(len(mesh.nodes), np.bool_)
    chosen[nodes] = True
    faces = mesh.triangles[chosen[mesh.triangles].all(axis=1)]
    if not len(faces):
        return float("nan")
    return float(np.linalg.norm(mesh.nodes[faces] - mesh.nodes[np.roll(faces, 1, axis=1)], axis=2).mean())
