"""Tetrahedral meshes of organs: generation, surface, and the .vtk file that Bullet reads."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["FEWEST_NODES", "Indices", "TetMesh", "block", "block_cells", "volumes"]

Indices = NDArray[np.int64]

FEWEST_NODES = 18
"""Nodes of the smallest symmetric block, 2 x 2 x 1 cells."""

_COUNT_TOLERANCE = 0.05
"""Of all grids whose node count is this near to the requested one, the one with the most cubic cells is taken."""

_CORNERS = np.array(list(product((0, 1), repeat=3)))  # (8, 3): corner number 4 i + 2 j + k stands at (i, j, k)
_CELL = np.array([[0, 4, 2, 1], [6, 2, 4, 7], [5, 4, 1, 7], [3, 1, 2, 7], [4, 2, 1, 7]])
"""Five positively oriented tetrahedra of a cube, four at the corners and one in the middle."""
_MIRRORED_CELL = (_CELL ^ 4)[:, [0, 2, 1, 3]]
"""The same, mirrored in x: neighbouring cells must alternate for their diagonals to meet."""

_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
"""Faces of a positively oriented tetrahedron, counter-clockwise seen from outside."""


@dataclass(frozen=True)
class TetMesh:
    """A body of linear tetrahedra, each with positive volume."""

    nodes: Vector
    """Shape (n, 3), metres."""
    tetrahedra: Indices
    """Shape (m, 4), node indices."""

    @property
    def triangles(self) -> Indices:
        """The surface, shape (f, 3), counter-clockwise seen from outside: the faces that belong to one tetrahedron only."""
        faces = self.tetrahedra[:, _FACES].reshape(-1, 3)
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        return faces[np.sort(first[count == 1])]

    def write_vtk(self, path: Path) -> None:
        """Write a legacy ASCII .vtk file, the only tetrahedral format that Bullet reads, without losing a bit of the nodes."""
        lines = ["# vtk DataFile Version 2.0", "organ", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(self.nodes)} double"]
        lines += [f"{x!r} {y!r} {z!r}" for x, y, z in self.nodes.tolist()]
        lines.append(f"CELLS {len(self.tetrahedra)} {5 * len(self.tetrahedra)}")
        lines += [f"4 {a} {b} {c} {d}" for a, b, c, d in self.tetrahedra.tolist()]
        lines.append(f"CELL_TYPES {len(self.tetrahedra)}")
        lines += ["10"] * len(self.tetrahedra)
        path.write_text("\n".join(lines) + "\n", encoding="ascii")


def volumes(nodes: Vector, tetrahedra: Indices) -> Vector:
    """Return the signed volume (m^3) of every tetrahedron, shape (m,)."""
    a, b, c, d = (nodes[tetrahedra[:, i]] for i in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0


def block(size: Vector, nodes: int) -> TetMesh:
    """Return a box of edge lengths `size` (m), shape (3,), with about `nodes` nodes; its top face is centred on the origin.

    A regular grid whose cells are cut into five tetrahedra each, the fewest there are, mirrored from cell to cell. With an
    even number of cells along x and y the mesh is its own mirror image in both, so it has no preferred diagonal.
    """
    cells = block_cells(size, nodes)
    points = (_grid(cells[0] + 1, cells[1] + 1, cells[2] + 1) / cells - [0.5, 0.5, 1.0]) * size
    strides = np.array([(cells[1] + 1) * (cells[2] + 1), cells[2] + 1, 1])
    origins = _grid(*cells)  # (c, 3)
    corners = (origins @ strides)[:, None] + _CORNERS @ strides  # (c, 8)
    odd = origins.sum(axis=1) % 2 == 1
    tetrahedra = np.where(odd[:, None, None], corners[:, _MIRRORED_CELL], corners[:, _CELL])  # (c, 5, 4)
    return TetMesh(points, tetrahedra.reshape(-1, 4))


def block_cells(size: Vector, nodes: int) -> tuple[int, int, int]:
    """Return the cells along x, y (even) and z of the grid that suits a box of `size` (m) and about `nodes` nodes."""

    def unfitness(cells: tuple[int, int, int]) -> tuple[float, ...]:
        edges = size / cells
        miss = abs(np.prod(np.add(cells, 1)) / nodes - 1.0)
        elongation = edges.max() / edges.min()
        return (0.0, elongation, miss, *cells) if miss <= _COUNT_TOLERANCE else (1.0, miss, elongation, *cells)

    most = max(1, nodes // 9)
    layouts = ((ny, nz) for nz in range(1, most + 1) for ny in range(2, nodes // (3 * (nz + 1)) + 2, 2))
    candidates = ((nx, ny, nz) for ny, nz in layouts for nx in _even_neighbours(nodes / ((ny + 1) * (nz + 1)) - 1.0))
    return min(candidates, key=unfitness)


def _grid(nx: int, ny: int, nz: int) -> Indices:
    """Return all (i, j, k) of a grid, shape (nx ny nz, 3), k the fastest."""
    return np.stack(np.meshgrid(np.arange(nx), np.arange(ny), np.arange(nz), indexing="ij"), axis=-1).reshape(-1, 3)


def _even_neighbours(x: float) -> tuple[int, int]:
    lower = max(2, 2 * int(x // 2))
    return lower, lower + 2
