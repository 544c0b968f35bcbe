"""Tetrahedra of regular grids: blocks and tubes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["FEWEST_NODES", "block", "block_cells", "grid_indices", "tetrahedra_of_cells"]

FEWEST_NODES = 18
"""Nodes of the smallest symmetric block, 2 x 2 x 1 cells."""

_GROWTH, _MOST_GROWING = 1.5, 60
"""Height of a row of cells over that of the row above, and most of such rows."""

_COUNT_TOLERANCE = 0.05
"""Tolerance of the node count: among the grids within the tolerance, the grid with the most cubic cells is
used.
"""

# (8, 3): corner number 4 i + 2 j + k stands at (i, j, k)
_CORNERS = np.array(list(product((0, 1), repeat=3)))
_CELL = np.array([[0, 4, 2, 1], [6, 2, 4, 7], [5, 4, 1, 7], [3, 1, 2, 7], [4, 2, 1, 7]])
"""Five positively oriented tetrahedra of a cube, four at the corners and the last in the middle."""
_MIRRORED_CELL = (_CELL ^ 4)[:, [0, 2, 1, 3]]
"""The same, mirrored in x: neighbouring cells must alternate for their diagonals to meet."""


def block(size: Vector, nodes: int, layers: Sequence[float] = (), rows: Sequence[int | None] = ()) -> TetMesh:
    """Return a box of edge lengths `size` (m), shape (3,), with about `nodes` nodes.

    The origin is in the middle of the top face. The cells of a regular grid are cut into five tetrahedra
    each, the fewest possible, mirrored from cell to cell. With an even number of cells along x and y the mesh
    is symmetric in both, without a preferred diagonal. Layers from the top down, of these thicknesses (m),
    have whole rows of cells, one at least.

    Where `rows` states the rows of a layer, the tissue below all layers is coarser from row to row.
    """
    cells = block_cells(size, nodes)
    heights = np.zeros(0)
    if layers:
        counts = [rows[i] if rows else None for i in range(len(layers))]
        heights = _row_heights(float(size[2]), cells[2], layers, counts)
        cells = cells[0], cells[1], len(heights) - 1
        if any(counts):
            cells = *_cells_across(size, nodes / len(heights)), len(heights) - 1
    indices = grid_indices(cells[0] + 1, cells[1] + 1, cells[2] + 1)
    points = (indices / cells - [0.5, 0.5, 1.0]) * size
    if layers:
        points[:, 2] = heights[indices[:, 2]]
    return TetMesh(points, tetrahedra_of_cells(cells))


def _row_heights(height: float, rows: int, layers: Sequence[float], counts: Sequence[int | None]) -> Vector:
    """Return the heights (m, from -height to 0) of about so many rows of cells.

    `counts`: rows of the layers from the top down, where they are stated.
    """
    base = height - plain_sum(layers)
    found = [count or max(1, round(rows * part / height)) for part, count in zip(layers, counts, strict=True)]
    below = np.full(max(1, round(rows * base / height)), 1.0)
    if any(counts):
        below = _growing_rows(base, layers[-1] / found[-1])
    planes = (-height + base * np.concatenate([[0.0], np.cumsum(below)]) / below.sum()).tolist()
    for part, count in zip(reversed(layers), reversed(found), strict=True):
        planes += (planes[-1] + part * np.arange(1, count + 1) / count).tolist()
    return np.array([*planes[:-1], 0.0])


def _growing_rows(height: float, least: float) -> Vector:
    """Return the relative heights of rows from the lowest up, each coarser than the row above.

    `least`: height of the row above all of them, m.
    """
    count = 1
    while count < _MOST_GROWING and least * plain_sum(_GROWTH ** (k + 1) for k in range(count)) < height:
        count += 1
    return np.array([_GROWTH**k for k in range(count, 0, -1)])


def _cells_across(size: Vector, nodes: float) -> tuple[int, int]:
    """Return even numbers of about square cells along x and y, for so many nodes of a level."""
    edge = float(np.sqrt(size[0] * size[1] / nodes))
    x, y = (max(2, 2 * round(0.5 * float(length) / edge)) for length in size[:2])
    return x, y


def tetrahedra_of_cells(cells: tuple[int, int, int], *, closed: bool = False) -> Indices:
    """Return the tetrahedra of a grid of `cells`, shape (5 cells, 4).

    The nodes of the grid are numbered with the last index the fastest.

    Args:
        cells: numbers of cells along three right-handed directions.
        closed: the second direction runs around: the last cells (an even number) end on the first nodes.
    """
    rows = cells[1] + (0 if closed else 1)
    origins = grid_indices(*cells)  # (c, 3)
    corners = origins[:, None] + _CORNERS  # (c, 8, 3)
    corners[:, :, 1] %= rows if closed else rows + 1
    numbers = corners @ np.array([rows * (cells[2] + 1), cells[2] + 1, 1])  # (c, 8)
    odd = origins.sum(axis=1) % 2 == 1
    return np.where(odd[:, None, None], numbers[:, _MIRRORED_CELL], numbers[:, _CELL]).reshape(-1, 4)


def block_cells(size: Vector, nodes: int) -> tuple[int, int, int]:
    """Return the cells along x, y (even) and z of the grid for a box of `size` (m) and `nodes` nodes."""

    def unfitness(cells: tuple[int, int, int]) -> tuple[float, ...]:
        edges = size / cells
        miss = abs(np.prod(np.add(cells, 1)) / nodes - 1.0)
        elongation = edges.max() / edges.min()
        return (
            (0.0, elongation, miss, *cells) if miss <= _COUNT_TOLERANCE else (1.0, miss, elongation, *cells)
        )

    most = max(1, nodes // 9)
    layouts = ((ny, nz) for nz in range(1, most + 1) for ny in range(2, nodes // (3 * (nz + 1)) + 2, 2))
    candidates = (
        (nx, ny, nz) for ny, nz in layouts for nx in _even_neighbours(nodes / ((ny + 1) * (nz + 1)) - 1.0)
    )
    return min(candidates, key=unfitness)


def grid_indices(nx: int, ny: int, nz: int) -> Indices:
    """Return all (i, j, k) of a grid, shape (nx ny nz, 3), k the fastest."""
    i, j, k = np.arange(nx), np.arange(ny), np.arange(nz)
    return np.stack(np.meshgrid(i, j, k, indexing="ij"), axis=-1).reshape(-1, 3)


def _even_neighbours(x: float) -> tuple[int, int]:
    lower = max(2, 2 * int(x // 2))
    return lower, lower + 2
