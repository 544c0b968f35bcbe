"""The inverse of a sparse stiffness between some of its nodes.

Nodes stand in levels: only neighbouring levels are coupled, so the matrix is block tridiagonal. Elimination
from the first level to the last, then the inverse level by level backwards (George and Liu, Computer Solution
of Large Sparse Positive Definite Systems, 1981, chapter 6).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices
from schemas.vectors import Vector

__all__ = ["inverse_between", "levels_of"]


def levels_of(nodes: Vector, pairs: Indices, which: NDArray[np.bool_]) -> Indices:
    """Return the level of every node of `which`, -1 of other nodes, shape (n,).

    Breadth first, from one end of the longest axis.

    Args:
        nodes: m, shape (n, 3).
        pairs: coupled nodes, shape (p, 2), both ways.
        which: nodes for the levels, shape (n,).
    """
    centred = nodes - nodes.mean(axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    along: Vector = centred @ axis
    edges = pairs[(which[pairs].all(axis=1)) & (pairs[:, 0] != pairs[:, 1])]
    lengths = np.linalg.norm(nodes[edges[:, 0]] - nodes[edges[:, 1]], axis=1)
    width = 0.5 * float(np.median(lengths)) if len(lengths) else 0.0
    level = np.full(len(nodes), -1)
    reached, left, number = np.zeros(len(nodes), np.bool_), which.copy(), 0
    while left.any():
        if not reached.any():  # the first level, or that of another part
            reached = left & (along <= along[left].min() + width)
        level[reached] = number
        left &= ~reached
        number += 1
        beyond = np.zeros_like(left)
        beyond[edges[reached[edges[:, 0]], 1]] = True
        reached = beyond & left
    return level


def inverse_between(pairs: Indices, blocks: Vector, level: Indices, kept: Indices) -> Vector:
    """Return the inverse between the `kept` nodes, shape (3 k, 3 k).

    Args:
        pairs: coupled nodes, shape (p, 2), both ways.
        blocks: stiffness of each pair, N/m, shape (p, 3, 3).
        level: level of every node, -1 of nodes that do not move, shape (n,).
        kept: nodes with a level, by their levels, shape (k,).
    """
    count = int(level.max()) + 1
    members = [np.flatnonzero(level == i) for i in range(count)]
    place = np.zeros(len(level), np.int64)
    for nodes in members:
        place[nodes] = np.arange(len(nodes))
    row, column = level[pairs].T

    def dense(i: int, j: int) -> Vector:
        """Return the matrix between two levels."""
        chosen = np.flatnonzero((row == i) & (column == j))
        found = np.zeros((len(members[i]), 3, len(members[j]), 3))
        at, to = place[pairs[chosen]].T
        found[at, :, to, :] = blocks[chosen]
        return found.reshape(3 * len(members[i]), -1)

    own: list[Vector] = []
    carried: list[Vector] = []
    matrix = dense(0, 0)
    for i in range(count):
        own.append(np.asarray(np.linalg.inv(matrix), np.float64))
        if i + 1 < count:
            beyond = dense(i, i + 1)
            carried.append(-own[i] @ beyond)
            matrix = dense(i + 1, i + 1) + beyond.T @ carried[i]
    starts = np.searchsorted(level[kept], np.arange(count + 1))
    inverse: Vector = np.zeros((3 * len(kept), 3 * len(kept)))
    whole, later = own[-1], np.zeros((len(own[-1]), 0))
    for i in range(count - 1, -1, -1):
        if i + 1 < count:
            nodes = _degrees(place[kept[starts[i + 1] : starts[i + 2]]])
            across = carried[i] @ whole
            later = np.concatenate([across[:, nodes], carried[i] @ later], axis=1)
            whole = own[i] + carried[i] @ across.T
        rows = slice(3 * starts[i], 3 * starts[i + 1])
        nodes = _degrees(place[kept[starts[i] : starts[i + 1]]])
        inverse[rows, rows] = whole[np.ix_(nodes, nodes)]
        inverse[rows, rows.stop :] = later[nodes]
        inverse[rows.stop :, rows] = later[nodes].T
    return inverse


def _degrees(nodes: Indices) -> Indices:
    """Return the rows of nodes, three each."""
    return (3 * nodes[:, None] + np.arange(3)).ravel()
