"""Tetrahedra for a smooth body, by isosurface stuffing.

A body-centred cubic lattice covers the body; vertices near the surface are moved onto the surface, and
tetrahedra still crossed by the surface are cut there (Labelle, Shewchuk, Isosurface Stuffing, ACM Trans.
Graph. 26, 2007).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engines.tissue.meshing.grid import grid_indices
from engines.tissue.meshing.tet_mesh import Indices, TetMesh, compact, volumes
from schemas.vectors import Vector

__all__ = ["Field", "fill"]

Field = Callable[[Vector], Vector]
"""Field over points, shape (n, 3), m: positive inside the body, negative outside, about the depth (m) near
the surface.
"""

_SNAP_LONG, _SNAP_SHORT = 0.24999, 0.41189
"""Largest distance, as a fraction of the edge, of a lattice vertex moved onto the surface (Labelle and
Shewchuk, table 2).
"""

_BISECTIONS = 20


def fill(field: Field, low: Vector, high: Vector, spacing: float) -> TetMesh:
    """Return the body of positive `field`.

    Args:
        field: field of the body.
        low: corner of a box around the body, m, shape (3,).
        high: opposite corner of the box, m, shape (3,).
        spacing: edge length (m) of the lattice's cubes; the body gets about two nodes per cube.
    """
    points, tetrahedra = _cubic_lattice(low, high, spacing)
    values = field(points)
    tetrahedra = tetrahedra[(values[tetrahedra] > 0.0).any(axis=1)]
    points, signs, edges, cuts = _snap_vertices(
        field, points, np.sign(values).astype(np.int64), tetrahedra, spacing
    )
    return compact(*_cut_tetrahedra(points, signs, tetrahedra, edges, cuts))


def _cubic_lattice(low: Vector, high: Vector, spacing: float) -> tuple[Vector, Indices]:
    """Return vertices and tetrahedra of a body-centred lattice over a box.

    Corners and centres of the cubes are symmetric about the middle of the box.
    """
    cubes = np.ceil((high - low) / spacing).astype(np.int64) + 2
    shape = 2 * cubes + 1  # places at half the spacing; corners of cubes are at even, centres at odd ones
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    places = grid_indices(*shape.tolist())
    points = (places - cubes) * (0.5 * spacing) + 0.5 * (low + high)
    centres = 2 * grid_indices(*cubes.tolist()) + 1
    parts: list[Indices] = []
    for axis in range(3):
        # towards the next centre, and along the square between
        step, one, other = np.roll(np.eye(3, dtype=np.int64), axis, axis=1)
        pairs = centres[(centres + 2 * step < shape - 1).all(axis=1)]
        around = [one + other, one - other, -one - other, other - one]
        for first, second in zip(around, around[1:] + around[:1], strict=True):
            corners = [pairs, pairs + 2 * step, pairs + step + first, pairs + step + second]
            parts.append(np.stack([corner @ strides for corner in corners], axis=1))
    return points, np.concatenate(parts)


def _snap_vertices(
    field: Field, points: Vector, signs: Indices, tetrahedra: Indices, spacing: float
) -> tuple[Vector, Indices, Indices, Vector]:
    """Move vertices near the surface onto the surface.

    Returns the points, their signs (0 on the surface), the edges still cut by the surface, shape (e, 2), and
    the points of the cuts, shape (e, 3).
    """
    pairs = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
    edges = np.unique(np.sort(tetrahedra[:, pairs].reshape(-1, 2), axis=1), axis=0)
    edges = edges[signs[edges[:, 0]] * signs[edges[:, 1]] < 0]
    inside = np.where(signs[edges[:, :1]] > 0, edges, edges[:, ::-1])  # first the end that is inside
    start, end = points[inside[:, 0]], points[inside[:, 1]]
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        within = field(start + middle[:, None] * (end - start)) > 0.0
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    cuts = start + low[:, None] * (end - start)
    length = np.linalg.norm(end - start, axis=1)
    reach = np.where(length > 0.95 * spacing, _SNAP_LONG, _SNAP_SHORT)
    vertices, share = inside.T.ravel(), np.concatenate([low, 1.0 - low]) / np.tile(reach, 2)
    order = np.lexsort((share, vertices))
    first = order[np.unique(vertices[order], return_index=True)[1]]
    near = first[share[first] < 1.0]
    points, signs = points.copy(), signs.copy()
    points[vertices[near]] = cuts[near % len(cuts)]
    signs[vertices[near]] = 0
    still = signs[edges[:, 0]] * signs[edges[:, 1]] < 0
    return points, signs, edges[still], cuts[still]


_STENCILS: dict[tuple[int, int], list[str]] = {
    (4, 0): ["abcd"],
    (3, 1): ["abcd"],
    (2, 2): ["abcd"],
    (1, 3): ["abcd"],
    (3, 0): ["abcR", "abQR", "aPQR"],
    (2, 1): ["abQc", "aPQc"],
    (2, 0): ["abQS", "aPQS", "aPRS"],
    (1, 2): ["abcP"],
    (1, 1): ["abPR"],
    (1, 0): ["aPQR"],
}
"""Kept parts of a tetrahedron by the numbers of vertices inside and on the surface. The vertices a to d are
sorted, inner vertices first; capital letters are cuts, named in `_CUTS`. A square face is halved from the
inner vertex of the lowest number, on both sides alike.
"""

_CUTS: dict[tuple[int, int], dict[str, str]] = {
    (3, 0): {"P": "ad", "Q": "bd", "R": "cd"},
    (2, 1): {"P": "ad", "Q": "bd"},
    (2, 0): {"P": "ac", "Q": "bc", "R": "ad", "S": "bd"},
    (1, 2): {"P": "ad"},
    (1, 1): {"P": "ac", "R": "ad"},
    (1, 0): {"P": "ab", "Q": "ac", "R": "ad"},
}


def _cut_tetrahedra(
    points: Vector, signs: Indices, tetrahedra: Indices, edges: Indices, cuts: Vector
) -> tuple[Vector, Indices]:
    """Return points and the inner tetrahedra."""
    count = len(points)
    keys = edges[:, 0] * count + edges[:, 1]  # ascending, as the edges are sorted
    order = np.argsort(-signs[tetrahedra] * 2 * count + tetrahedra, axis=1)
    tetrahedra = np.take_along_axis(tetrahedra, order, axis=1)
    inner, on = (signs[tetrahedra] > 0).sum(axis=1), (signs[tetrahedra] == 0).sum(axis=1)
    parts: list[Indices] = []
    for (n, z), stencil in _STENCILS.items():
        these = tetrahedra[(inner == n) & (on == z)]
        letters = dict(zip("abcd", these.T, strict=True))
        for letter, (one, other) in _CUTS.get((n, z), {}).items():
            ends = np.sort(np.stack([letters[one], letters[other]]), axis=0)
            letters[letter] = count + np.searchsorted(keys, ends[0] * count + ends[1])
        parts += [np.stack([letters[letter] for letter in corners], axis=1) for corners in stencil]
    points, kept = np.concatenate([points, cuts]), np.concatenate(parts)
    inverted = volumes(points, kept) < 0.0
    kept[inverted] = kept[inverted][:, [0, 1, 3, 2]]
    return points, kept
