"""Checks of a user's mesh: every obstacle to its use, with the remedy."""

from __future__ import annotations

import numpy as np

from engines.tissue.meshing.tet_mesh import Indices, TetMesh, shape_quality
from schemas.vectors import Vector

__all__ = ["LARGEST_M", "MOST_NODES", "SMALLEST_M", "checked_mesh"]

MOST_NODES = 5000
"""A step of 1 ms takes some 15 ms with as many at rest (bench/organs.py)."""

SMALLEST_M, LARGEST_M = 5e-3, 1.0
"""Extent of an organ: from a lymph node to more than any abdominal organ."""

_FLATTEST = 0.02
"""Least shape quality: the flatter a tetrahedron, the shorter the stable step.

Generated organs have more than 0.25 (docs/decisions/0014-organs.md).
"""

_SAME_PLACE = 1e-6
"""Nodes nearer than this share of the mesh's extent are at the same place."""

_SHOWN = 5


def checked_mesh(nodes: Vector, tetrahedra: Indices) -> TetMesh:
    """Return the mesh. Raises ValueError with all problems of the mesh.

    Args:
        nodes: shape (n, 3), m.
        tetrahedra: shape (m, 4).
    """
    problems = (
        _numbers(nodes, tetrahedra)
        or _size(nodes)
        or [*_shapes(nodes, tetrahedra), *_surface(nodes, TetMesh(nodes, tetrahedra))]
    )
    if problems:
        raise ValueError("the mesh cannot be used: " + "; ".join(problems))
    return TetMesh(nodes, tetrahedra)


def _first_indices(indices: Indices) -> str:
    listed = ", ".join(str(i) for i in indices[:_SHOWN].tolist())
    return listed + (" ..." if len(indices) > _SHOWN else "")


def _numbers(nodes: Vector, tetrahedra: Indices) -> list[str]:
    """Return the problems preventing any further check."""
    if not 4 <= len(nodes) <= MOST_NODES or not len(tetrahedra):
        return [
            f"it has {len(nodes)} nodes and {len(tetrahedra)} tetrahedra; 4 to {MOST_NODES} nodes are"
            " allowed, and 250 run in real time"
        ]
    infinite = np.flatnonzero(~np.isfinite(nodes).all(axis=1))
    if len(infinite):
        return [f"{len(infinite)} nodes are not finite: {_first_indices(infinite)}"]
    outside = np.flatnonzero(((tetrahedra < 0) | (tetrahedra >= len(nodes))).any(axis=1))
    if len(outside):
        return [
            f"{len(outside)} tetrahedra name nodes that there are not (there are 0 to {len(nodes) - 1}):"
            f" {_first_indices(outside)}"
        ]
    return []


def _size(nodes: Vector) -> list[str]:
    extent = float(np.ptp(nodes, axis=0).max())
    if extent > LARGEST_M:
        return [
            f"it is {extent:.4g} m large: is the file in millimetres? State `unit: mm`. Up to {LARGEST_M:g}"
            " m are allowed"
        ]
    if extent < SMALLEST_M:
        return [
            f"it is {1e3 * extent:.4g} mm large: is the file in metres? State `unit: m`. At least"
            f" {1e3 * SMALLEST_M:g} mm are allowed"
        ]
    return []


def _shapes(nodes: Vector, tetrahedra: Indices) -> list[str]:
    quality = shape_quality(nodes, tetrahedra)
    inverted, flat = np.flatnonzero(quality <= -_FLATTEST), np.flatnonzero(np.abs(quality) < _FLATTEST)
    problems: list[str] = []
    if len(inverted) == len(tetrahedra):
        problems.append(
            "all tetrahedra are inverted: swap two nodes of each (in VTK node 3 is on the side to which the"
            " normal of 0, 1, 2 points)"
        )
    elif len(inverted):
        problems.append(
            f"{len(inverted)} of {len(tetrahedra)} tetrahedra are inverted: {_first_indices(inverted)}"
        )
    if len(flat):
        problems.append(
            f"{len(flat)} of {len(tetrahedra)} tetrahedra are degenerate, with a shape quality below"
            f" {_FLATTEST:g} (1 is regular): {_first_indices(flat)}"
        )
    unused = np.setdiff1d(np.arange(len(nodes)), tetrahedra)
    if len(unused):
        problems.append(f"{len(unused)} nodes belong to no tetrahedron: {_first_indices(unused)}")
    return problems


def _surface(nodes: Vector, mesh: TetMesh) -> list[str]:
    """Return the problems of the surface: not closed, not simple, or in several pieces."""
    problems: list[str] = []
    crowded = mesh.crowded
    if len(crowded):
        problems.append(
            f"{len(crowded)} faces belong to three tetrahedra or more, for instance that of nodes"
            f" {crowded[0].tolist()}"
        )
    triangles = mesh.triangles
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, counts = np.unique(edges, axis=0, return_counts=True)
    open_edges = edges[counts != 2]
    if len(open_edges):
        problems.append(
            f"the surface is not watertight: {len(open_edges)} edges have not two triangles, for instance"
            f" between nodes {open_edges[0].tolist()}"
        )
    apart = _SAME_PLACE * np.ptp(nodes, axis=0).max()
    places = np.rint(nodes / apart)
    order = np.lexsort((places[:, 2], places[:, 1], places[:, 0]))
    near = np.linalg.norm(np.diff(nodes[order], axis=0), axis=1) < apart
    if near.any():
        pairs = np.sort(order[1:][near])
        problems.append(
            f"{len(pairs)} nodes lie where others are, so the mesh is cracked there; merge them:"
            f" {_first_indices(pairs)}"
        )
    pieces = _count_pieces(mesh)
    if pieces > 1:
        problems.append(
            f"it is in {pieces} pieces, which share no face; an organ is one: make them organs of their own"
        )
    return problems


def _count_pieces(mesh: TetMesh) -> int:
    """Return the number of parts of the mesh without a common face."""
    face = mesh.face_numbers
    label = np.arange(len(face))
    while True:
        least = np.full(int(face.max()) + 1, len(face))
        np.minimum.at(least, face.ravel(), np.repeat(label, 4))
        new = least[face].min(axis=1)
        new = new[new]
        if (new == label).all():
            return len(np.unique(label))
        label = new
