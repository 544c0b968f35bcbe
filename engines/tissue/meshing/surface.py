"""Surfaces of triangles as other programs leave them, and how they are mended."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices
from schemas.vectors import Vector

__all__ = ["Surface", "bisect_long_edges", "join_surfaces", "mend_surface"]

_SAME_PLACE = 5e-5
"""Vertices nearer than this share of the extent are one vertex: 32 bits of an STL far from the origin."""

_OPEN = 0.3
"""Sum of area vectors over area: 0 of a closed surface, 0.5 of half a sphere, 1 of a plane."""


class Surface(NamedTuple):
    """Triangles."""

    vertices: Vector
    """Shape (n, 3)."""
    triangles: Indices
    """Shape (f, 3), counter-clockwise seen from outside once mended."""

    @property
    def area_vectors(self) -> Vector:
        """Normal times area of each triangle, shape (f, 3)."""
        a, b, c = (self.vertices[self.triangles[:, i]] for i in range(3))
        return 0.5 * np.cross(b - a, c - a)

    @property
    def middles(self) -> Vector:
        """Middle of each triangle, shape (f, 3)."""
        return self.vertices[self.triangles].mean(axis=1)


def join_surfaces(surfaces: list[Surface]) -> Surface:
    """Return all triangles as one surface."""
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)]).tolist()
    return Surface(
        np.concatenate([surface.vertices for surface in surfaces]),
        np.concatenate([one.triangles + start for one, start in zip(surfaces, starts[:-1], strict=True)]),
    )


def mend_surface(surface: Surface) -> tuple[Surface, list[str]]:
    """Return the surface with one vertex a place, no flat triangles and normals outwards; and the changes."""
    changes: list[str] = []
    vertices, triangles = _weld(surface)
    used = len(np.unique(surface.triangles))
    if used > len(vertices) and used != 3 * len(surface.triangles):  # an STL has no common vertices
        changes.append(f"{used - len(vertices)} of {used} vertices were where others are: merged")
    flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    kept = np.zeros(len(triangles), np.bool_)
    kept[first] = True
    kept &= ~flat
    if not kept.all():
        changes.append(f"{len(kept) - int(kept.sum())} triangles had no area or stood twice: left out")
    triangles = triangles[kept]
    turned = _disagreeing(triangles)
    triangles = np.where(turned[:, None], triangles[:, ::-1], triangles)
    if turned.any():
        changes.append(f"{int(turned.sum())} triangles faced the other way than their neighbours: turned")
    mended = Surface(vertices, triangles)
    inverted = _inverted(mended)
    if inverted.any():
        changes.append(f"{int(inverted.sum())} triangles had their normals inwards: turned")
        mended = Surface(vertices, np.where(inverted[:, None], triangles[:, ::-1], triangles))
    if holes := int((_edges(mended.triangles)[2] == 1).sum()):
        changes.append(f"{holes} edges have one triangle: the holes there are closed")
    return mended, changes


def bisect_long_edges(surface: Surface, longest: float) -> Surface:
    """Return the same surface in triangles without edges above `longest`; neighbours need not match."""
    corners, done = surface.vertices[surface.triangles], list[Vector]()
    while len(corners):
        lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        short = lengths.max(axis=1) <= longest
        done.append(corners[short])
        corners, lengths = corners[~short], lengths[~short]
        turns = (lengths.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, turns[:, :, None], axis=1).transpose(1, 0, 2)
        middle = 0.5 * (a + b)
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    soup = np.concatenate(done)
    return Surface(soup.reshape(-1, 3), np.arange(3 * len(soup)).reshape(-1, 3))


def _weld(surface: Surface) -> Surface:
    """Return the surface with one vertex for those at the same place."""
    tree: Any = import_module("scipy.spatial").cKDTree(surface.vertices)
    near = _SAME_PLACE * float(np.ptp(surface.vertices, axis=0).max())
    pairs: Indices = tree.query_pairs(near, output_type="ndarray").astype(np.int64)
    _, label = _components(len(surface.vertices), pairs)
    _, first = np.unique(label, return_index=True)
    used, numbers = np.unique(label[surface.triangles], return_inverse=True)
    return Surface(surface.vertices[first][used], numbers.reshape(-1, 3))


def _components(count: int, pairs: Indices) -> tuple[int, Indices]:
    """Return number and labels, shape (count,), of the parts connected by `pairs`, shape (p, 2)."""
    sparse: Any = import_module("scipy.sparse")
    graph = sparse.coo_matrix((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    number, label = import_module("scipy.sparse.csgraph").connected_components(graph, directed=False)
    return int(number), np.asarray(label, np.int64)


def _edges(triangles: Indices) -> tuple[Indices, NDArray[np.bool_], Indices]:
    """Return number and direction of the edges of every triangle, shapes (3 f,), and triangles by edge."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    _, number, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    return number.reshape(-1), ends[:, 0] < ends[:, 1], count


def _neighbours(triangles: Indices) -> tuple[Indices, NDArray[np.bool_]]:
    """Return pairs of triangles with a common edge, shape (p, 2), and whether their sides agree, shape (p,).

    Edges of three triangles and more are left out.
    """
    number, forward, count = _edges(triangles)
    order = np.argsort(number, kind="stable")
    places = order[count[number[order]] == 2].reshape(-1, 2)
    return places // 3, forward[places[:, 0]] != forward[places[:, 1]]


def _disagreeing(triangles: Indices) -> NDArray[np.bool_]:
    """Return which triangles, shape (f,), face the other way than most of their part of the surface.

    Every triangle is there twice, as it is and turned; a part of the surface becomes two components, each
    with all sides agreeing. The component with more triangles as they are is taken.
    """
    count = len(triangles)
    pairs, agree = _neighbours(triangles)
    other = np.where(agree, pairs[:, 1], pairs[:, 1] + count)
    links = np.concatenate(
        [np.stack([pairs[:, 0], other], 1), np.stack([pairs[:, 0] + count, (other + count) % (2 * count)], 1)]
    )
    parts, label = _components(2 * count, links)
    as_they_are = np.bincount(label[:count], minlength=parts)
    return as_they_are[label[count:]] > as_they_are[label[:count]]


def _inverted(surface: Surface) -> NDArray[np.bool_]:
    """Return the triangles, shape (f,), of parts with their normals inwards.

    A part inside another is a cavity, and stays.
    """
    pairs, _ = _neighbours(surface.triangles)
    parts, label = _components(len(surface.triangles), pairs)
    inward = np.zeros(parts, np.bool_)
    lows, highs = np.empty((parts, 3)), np.empty((parts, 3))
    corners = surface.vertices[surface.triangles]
    order = np.argsort(label, kind="stable")
    for part, rows in enumerate(np.split(order, np.flatnonzero(np.diff(label[order])) + 1)):
        lows[part], highs[part] = corners[rows].min(axis=(0, 1)), corners[rows].max(axis=(0, 1))
        around = corners[rows] - 0.5 * (lows[part] + highs[part])
        vectors = 0.5 * np.cross(around[:, 1] - around[:, 0], around[:, 2] - around[:, 0])
        is_closed = np.linalg.norm(vectors.sum(axis=0)) < _OPEN * np.linalg.norm(vectors, axis=1).sum()
        inward[part] = is_closed and np.vdot(around.mean(axis=1), vectors) < 0.0
    for part in np.flatnonzero(inward).tolist():
        around = (lows <= lows[part]).all(axis=1) & (highs >= highs[part]).all(axis=1)
        inward[part] = around.sum() == 1  # itself
    return inward[label]
