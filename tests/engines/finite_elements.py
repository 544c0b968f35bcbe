"""The truth for Bullet's tissue: internal forces of its neo-Hookean material on linear tetrahedra, written from the paper.

Energy density of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (2018), equation 14, with a = 1 + 3 mu / (4 lambda):
mu/2 (I_C - 3) + lambda/2 (J - a)^2 - mu/2 log(I_C + 1). Its derivative by F, times the gradients of the shape functions, is
the force that the elements exert on the nodes.
"""

import numpy as np


def internal_forces(rest, tetrahedra, nodes, mu, lambda_):
    """Return the elastic force (N) on every node, shape (n, 3)."""
    rest_edges = (rest[tetrahedra[:, 1:]] - rest[tetrahedra[:, :1]]).transpose(0, 2, 1)
    edges = (nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]).transpose(0, 2, 1)
    inverse = np.linalg.inv(rest_edges)
    volume = np.linalg.det(rest_edges) / 6
    F = edges @ inverse
    J = np.linalg.det(F)[:, None, None]
    trace = np.einsum("mij,mij->m", F, F)[:, None, None]
    cofactor = J * np.linalg.inv(F).transpose(0, 2, 1)
    alpha = 1 + 3 * mu / (4 * lambda_)
    P = mu * F * (1 - 1 / (trace + 1)) + lambda_ * (J - alpha) * cofactor
    on_last_three = -(P @ inverse.transpose(0, 2, 1)) * volume[:, None, None]  # columns: forces on nodes 1 to 3
    forces = np.zeros_like(rest)
    for i in range(3):
        np.add.at(forces, tetrahedra[:, i + 1], on_last_three[:, :, i])
    np.add.at(forces, tetrahedra[:, 0], -on_last_three.sum(axis=2))
    return forces


def energy(rest, tetrahedra, nodes, mu, lambda_):
    """Return the elastic energy (J), up to a constant."""
    rest_edges = (rest[tetrahedra[:, 1:]] - rest[tetrahedra[:, :1]]).transpose(0, 2, 1)
    F = (nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]).transpose(0, 2, 1) @ np.linalg.inv(rest_edges)
    J, trace = np.linalg.det(F), np.einsum("mij,mij->m", F, F)
    density = mu / 2 * (trace - 3) + lambda_ / 2 * (J - 1 - 3 * mu / (4 * lambda_)) ** 2 - mu / 2 * np.log(trace + 1)
    return float((np.linalg.det(rest_edges) / 6 * density).sum())
