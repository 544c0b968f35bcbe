"""Elastic forces of Bullet's neo-Hookean material at some nodes of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["Elasticity"]


class Elasticity:
    """Elastic forces of the tetrahedra around a node.

    Energy density of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (ACM Trans. Graph. 37, 2018),
    equation 14: with a = 1 + 3 mu / (4 lambda), the stress is P = mu (1 - 1 / (tr F^T F + 1)) F + lambda (J -
    a) cof F.
    """

    def __init__(self, mesh: TetMesh, material: Material) -> None:
        corners = mesh.nodes[mesh.tetrahedra]
        inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))  # (m, 3, 3)
        # (m, 4, 3), of the shape functions
        self._gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self._weighted = self._gradients / (6.0 * np.linalg.det(inverse))[:, None, None]  # times the volume
        self._tetrahedra = mesh.tetrahedra
        self._mu, self._lambda = material.neo_hookean_lame
        self._alpha = 1.0 + 0.75 * self._mu / self._lambda

    def forces(self, nodes: Vector, at: NDArray[np.bool_]) -> Vector:
        """Return the elastic force (N) on every node marked in `at`, shape (n,), and zeros elsewhere.

        nodes: deformed nodes, m, shape (n, 3).
        """
        around = at[self._tetrahedra].any(axis=1)
        tetrahedra: Indices = self._tetrahedra[around]
        F = np.einsum("mai,maj->mij", nodes[tetrahedra], self._gradients[around])
        cofactor = np.stack([cross(F[:, :, (i + 1) % 3], F[:, :, (i + 2) % 3]) for i in range(3)], axis=2)
        J = np.einsum("mi,mi->m", F[:, :, 0], cofactor[:, :, 0])
        stretch = self._mu * (1.0 - 1.0 / (np.einsum("mij,mij->m", F, F) + 1.0))
        stress = stretch[:, None, None] * F + (self._lambda * (J - self._alpha))[:, None, None] * cofactor
        forces = np.einsum("mij,maj->mai", stress, self._weighted[around])
        total = np.stack(
            [np.bincount(tetrahedra.ravel(), -forces[..., i].ravel(), len(nodes)) for i in range(3)], axis=1
        )
        return np.where(at[:, None], total, 0.0)
