"""The linear yield of an anchored body under a force on its surface, for bodies of some thousand nodes.

A body is a half-space at the place of the force plus the effect of all other boundaries: Boussinesq's field
is cancelled at free faces and anchored nodes, on the mesh.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.tissue.elasticity.half_space import point_displacement, point_traction
from engines.tissue.elasticity.sparse_inverse import inverse_between, levels_of
from engines.tissue.elasticity.stiffness import pair_blocks
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from schemas.vectors import Vector

__all__ = ["MOST_NODES", "BodyYield"]

MOST_NODES = 3500
"""Most nodes: 200 MB and some seconds at this size."""

_POINTS: Vector = np.full((3, 3), 1 / 6) + 0.5 * np.eye(3)
"""Barycentric coordinates of the points of a face, of equal weight, for the integral of a quadratic function
(Strang and Fix, An Analysis of the Finite Element Method, 1973).
"""


class BodyYield:
    """Displacements under forces on surface nodes."""

    def __init__(
        self, mesh: TetMesh, anchored: NDArray[np.bool_], faces: Indices, material: Material
    ) -> None:
        """`anchored`: shape (n,), some true; `faces`: free faces, shape (f, 3)."""
        self._mesh, self._material, self._faces, self._anchored = mesh, material, faces, anchored
        pairs, blocks = pair_blocks(mesh, material)
        tied = ~anchored[pairs[:, 0]] & anchored[pairs[:, 1]]
        self._pairs, self._blocks = pairs[tied], blocks[tied]
        level = levels_of(mesh.nodes, pairs, ~anchored)
        loaded = np.zeros(len(anchored), np.bool_)
        loaded[faces] = loaded[self._pairs[:, 0]] = True
        kept = np.flatnonzero(loaded & ~anchored)
        kept = kept[np.argsort(level[kept], kind="stable")]
        free = ~anchored[pairs].any(axis=1)
        self._inverse = inverse_between(pairs[free], blocks[free], level, kept)
        self._place = np.full(len(anchored), -1)
        self._place[kept] = np.arange(len(kept))
        corners = mesh.nodes[faces]
        self._points = (_POINTS @ corners).reshape(-1, 3)
        areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._areas = np.repeat(areas, 3, axis=0)

    def between(self, surface: Indices) -> Vector:
        """Return the displacement (m) of each surface node under 1 N on each, shape (s, s, 3, 3)."""
        found = np.zeros((len(surface), len(surface), 3, 3))
        moving = np.flatnonzero(~self._anchored[surface])
        at = self._place[surface[moving]]
        k = len(self._inverse) // 3
        of_kept = self._inverse.reshape(k, 3, k, 3)
        for row, place in zip(moving.tolist(), at.tolist(), strict=True):
            found[row, moving] = of_kept[place][:, at].transpose(1, 0, 2)
        return found

    def of_boundaries(self, node: int, inward: Vector) -> float:
        """Return the displacement by the other boundaries under 1 N along `inward` on a node, m."""
        if self._anchored[node]:
            return 0.0
        mesh, material = self._mesh, self._material
        moved: Vector = np.zeros((len(self._anchored), 3))  # of all nodes by 1 N on this node
        known = self._place >= 0
        first = 3 * self._place[node]
        moved[known] = (inward @ self._inverse[first : first + 3]).reshape(-1, 3)[self._place[known]]
        areas = np.where(np.repeat((self._faces == node).any(axis=1), 3)[:, None], 0.0, self._areas)
        traction = point_traction(self._points - mesh.nodes[node], inward, areas, material)
        by_faces = float(np.vdot(traction, (_POINTS @ moved[self._faces]).reshape(-1, 3))) / 3.0
        held: Vector = np.zeros_like(moved)
        held[self._anchored] = point_displacement(
            mesh.nodes[self._anchored] - mesh.nodes[node], inward, material
        )
        free, fixed = self._pairs.T
        pushed: Vector = np.matmul(self._blocks, held[fixed, :, None])[:, :, 0]
        return float(np.vdot(moved[free], pushed)) - by_faces
