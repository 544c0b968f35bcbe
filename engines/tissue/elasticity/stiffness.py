"""The stiffness of a mesh of linear tetrahedra at rest, by pairs of nodes."""

from __future__ import annotations

import numpy as np

from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from schemas.vectors import Vector

__all__ = ["element_blocks", "pair_blocks"]


def element_blocks(mesh: TetMesh, material: Material) -> Vector:
    """Return the stiffness (N/m) of every element between its corners, shape (m, 4, 3, 4, 3)."""
    edges = mesh.nodes[mesh.tetrahedra[:, 1:]] - mesh.nodes[mesh.tetrahedra[:, :1]]
    inverse = np.linalg.inv(edges)
    gradients = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2).transpose(0, 2, 1)
    mu, lambda_ = material.lame
    dyads = np.einsum("mai,mbj->maibj", gradients, gradients)
    blocks = lambda_ * dyads + mu * dyads.transpose(0, 1, 4, 3, 2)
    blocks += mu * np.einsum("maibi,jk->majbk", dyads, np.eye(3))
    blocks *= (np.linalg.det(edges) / 6.0)[:, None, None, None, None]
    return blocks


def pair_blocks(mesh: TetMesh, material: Material) -> tuple[Indices, Vector]:
    """Return all pairs of coupled nodes, shape (p, 2), in order, and their stiffness (N/m), (p, 3, 3)."""
    tetrahedra, count = mesh.tetrahedra, len(mesh.nodes)
    keys = (tetrahedra[:, :, None] * count + tetrahedra[:, None, :]).ravel()
    pairs, places = np.unique(keys, return_inverse=True)
    blocks = element_blocks(mesh, material).transpose(0, 1, 3, 2, 4).reshape(-1, 9)
    columns = [np.bincount(places, column, len(pairs)).astype(np.float64) for column in blocks.T]
    sums = np.stack(columns, axis=1)
    return np.stack(np.divmod(pairs, count), axis=1), sums.reshape(-1, 3, 3)
