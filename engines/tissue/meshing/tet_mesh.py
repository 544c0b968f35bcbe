"""Tetrahedral meshes of organs: surface, quality, and the .vtk file for Bullet."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["Indices", "TetMesh", "compact", "dihedral_angles", "shape_quality", "volumes"]

Indices = NDArray[np.int64]

_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
"""Faces of a positively oriented tetrahedron, counter-clockwise seen from outside."""


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A body of linear tetrahedra, each with positive volume."""

    nodes: Vector
    """Shape (n, 3), metres."""
    tetrahedra: Indices
    """Shape (m, 4), node indices."""

    @cached_property
    def triangles(self) -> Indices:
        """The surface, shape (f, 3), counter-clockwise seen from outside.

        The faces belong to a single tetrahedron each.
        """
        return self._faces[self._shared == 1]

    @property
    def crowded(self) -> Indices:
        """Faces of more than two tetrahedra, shape (f, 3): empty for a sound mesh."""
        return self._faces[self._shared > 2]

    @cached_property
    def face_numbers(self) -> Indices:
        """Numbers of the four faces of every tetrahedron, shape (m, 4): equal for the same three nodes."""
        _, numbers = np.unique(np.sort(self._faces, axis=1), axis=0, return_inverse=True)
        return numbers.reshape(-1, 4)

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return float(volumes(self.nodes, self.tetrahedra).sum())

    @property
    def _faces(self) -> Indices:
        return self.tetrahedra[:, _FACES].reshape(-1, 3)

    @property
    def _shared(self) -> Indices:
        """By how many tetrahedra every face is shared, shape (4 m,)."""
        numbers = self.face_numbers.ravel()
        return np.bincount(numbers)[numbers]

    def write_vtk(self, path: Path) -> None:
        """Write a legacy ASCII .vtk file, Bullet's only tetrahedral format."""
        path.write_text(self.vtk_text, encoding="ascii")

    @property
    def vtk_text(self) -> str:
        """The mesh as a legacy ASCII .vtk file. The nodes read back bit for bit."""
        lines = [
            "# vtk DataFile Version 2.0",
            "organ",
            "ASCII",
            "DATASET UNSTRUCTURED_GRID",
            f"POINTS {len(self.nodes)} double",
        ]
        lines += [f"{x!r} {y!r} {z!r}" for x, y, z in self.nodes.tolist()]
        lines.append(f"CELLS {len(self.tetrahedra)} {5 * len(self.tetrahedra)}")
        lines += [f"4 {a} {b} {c} {d}" for a, b, c, d in self.tetrahedra.tolist()]
        lines.append(f"CELL_TYPES {len(self.tetrahedra)}")
        lines += ["10"] * len(self.tetrahedra)
        return "\n".join(lines) + "\n"


def volumes(nodes: Vector, tetrahedra: Indices) -> Vector:
    """Return the signed volume (m^3) of every tetrahedron, shape (m,)."""
    a, b, c, d = (nodes[tetrahedra[:, i]] for i in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0


def compact(nodes: Vector, tetrahedra: Indices) -> TetMesh:
    """Return a mesh of the nodes in tetrahedra, in the same order."""
    used, renumbered = np.unique(tetrahedra, return_inverse=True)
    return TetMesh(nodes[used], renumbered.reshape(-1, 4))


def shape_quality(nodes: Vector, tetrahedra: Indices) -> Vector:
    """Return the mean ratio of every tetrahedron, shape (m,): 1 is regular, 0 flat, negative inverted.

    12 (3 volume)^(2/3) / sum of squared edges: Liu, Joe, Relationship between tetrahedron shape
    measures, BIT 34 (1994).
    """
    corners = nodes[tetrahedra]  # (m, 4, 3)
    squares = sum(((corners[:, i] - corners[:, j]) ** 2).sum(axis=1) for i, j in combinations(range(4), 2))
    return (
        12.0 * np.cbrt(3.0 * volumes(nodes, tetrahedra)) ** 2 * np.sign(volumes(nodes, tetrahedra)) / squares
    )


def dihedral_angles(nodes: Vector, tetrahedra: Indices) -> Vector:
    """Return the six angles (rad) between the faces of every tetrahedron, shape (m, 6)."""
    faces = nodes[tetrahedra[:, _FACES]]  # (m, 4, 3, 3)
    normals = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    cosines = [-np.einsum("mi,mi->m", normals[:, i], normals[:, j]) for i, j in combinations(range(4), 2)]
    return np.arccos(np.clip(np.stack(cosines, axis=1), -1.0, 1.0))
