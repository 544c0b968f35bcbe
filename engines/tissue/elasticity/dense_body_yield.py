"""The linear yield of an anchored body under a force on its surface, by a dense inverse.

For kind `bullet`, whose recordings have the bits of this order of sums; `body_yield` has the same numbers for
larger meshes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.tissue.elasticity.half_space import point_displacement, point_stress
from engines.tissue.elasticity.stiffness import element_blocks
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from schemas.vectors import Vector

__all__ = ["MOST_NODES", "DenseBodyYield"]

MOST_NODES = 1200
"""Most nodes: a dense matrix of 100 MB and some seconds at this size."""

_POINTS: Vector = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
"""Barycentric coordinates of the points, of equal weight, for the integral of a quadratic function over a
face (Strang and Fix, An Analysis of the Finite Element Method, 1973).
"""


class DenseBodyYield:
    """Displacements under forces on surface nodes; methods as in `BodyYield`."""

    def __init__(
        self, mesh: TetMesh, anchored: NDArray[np.bool_], faces: Indices, material: Material
    ) -> None:
        """`anchored`: shape (n,), some true; `faces`: free faces, (f, 3); at most `MOST_NODES` nodes."""
        self._mesh, self._anchored, self._faces, self._material = mesh, anchored, faces, material
        stiffness = _stiffness(mesh, material)
        free, fixed = (np.flatnonzero(np.repeat(which, 3)) for which in (~anchored, anchored))
        inverse: Vector = np.zeros_like(stiffness)
        inverse[np.ix_(free, free)] = np.linalg.inv(stiffness[np.ix_(free, free)])
        self._blocks = inverse.reshape(len(mesh.nodes), 3, len(mesh.nodes), 3)
        self._tied = stiffness[:, fixed]

    def between(self, surface: Indices) -> Vector:
        """Return the displacement (m) of each surface node under 1 N on each, shape (s, s, 3, 3)."""
        return self._blocks[surface][:, :, surface].transpose(0, 2, 1, 3)

    def of_boundaries(self, node: int, inward: Vector) -> float:
        """Return the displacement by the other boundaries under 1 N along `inward` on a node, m."""
        if self._anchored[node]:
            return 0.0
        mesh, material = self._mesh, self._material
        held = -point_displacement(mesh.nodes[self._anchored] - mesh.nodes[node], inward, material).ravel()
        pushed = _cancelling_forces(mesh.nodes, self._faces, node, inward, material).ravel()
        return float(inward @ self._blocks[node].reshape(3, -1) @ (pushed - self._tied @ held))


def _stiffness(mesh: TetMesh, material: Material) -> Vector:
    """Return the stiffness (N/m) of linear tetrahedra at rest, shape (3 n, 3 n)."""
    tetrahedra, size = mesh.tetrahedra, 3 * len(mesh.nodes)
    blocks = element_blocks(mesh, material)
    places = (3 * tetrahedra[:, :, None] + np.arange(3)).reshape(-1, 12)
    cells = (places[:, :, None] * size + places[:, None, :]).ravel()
    return np.bincount(cells, blocks.ravel(), size * size).astype(np.float64).reshape(size, size)


def _cancelling_forces(
    nodes: Vector, faces: Indices, node: int, inward: Vector, material: Material
) -> Vector:
    """Return the forces (N), shape (n, 3), against the stress on the faces of 1 N along `inward` on a node.

    Faces around the node itself are left out: they are the surface of the half-space.
    """
    others = faces[(faces != node).all(axis=1)]
    corners = nodes[others]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    points = np.einsum("qa,fai->fqi", _POINTS, corners)
    stress = point_stress((points - nodes[node]).reshape(-1, 3), inward, material).reshape(*points.shape, 3)
    forces = -np.einsum("fqij,fj,qa->fai", stress, areas, _POINTS) / len(_POINTS)
    total = np.zeros_like(nodes)
    np.add.at(total, others, forces)
    return total
