"""The natural frequencies of a mesh, and its stiffness against a part that moves."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import TetMesh, volumes
from schemas.vectors import Vector

__all__ = ["highest_frequency", "lowest_frequency", "patch_stiffness"]

_POWER_ITERATIONS = 200

_SAG_ITERATIONS, _SAG_TOLERANCE = 300, 0.1
"""Limits of conjugate gradients for the sag: enough for the lowest frequency to one percent."""


def highest_frequency(mesh: TetMesh, free: Vector, material: Material) -> float:
    """Return the highest natural frequency (rad/s) of the mesh about the resting shape.

    Args:
        mesh: the body; as in Bullet, all nodes have the same mass.
        free: 1 for free nodes, 0 for anchored nodes, shape (n,).
        material: linearised.
    """
    stiffness = _stiffness_per_mass(mesh, free, material)
    mode = np.random.default_rng(0).standard_normal(mesh.nodes.shape) * free[:, None]
    square = 0.0
    for _ in range(_POWER_ITERATIONS):
        mode = stiffness(mode / np.linalg.norm(mode))
        square = float(np.linalg.norm(mode))
    return sqrt(square)


def lowest_frequency(mesh: TetMesh, free: Vector, material: Material) -> float:
    """Return the lowest natural frequency (rad/s) excited by weight along z.

    Rayleigh's quotient of the sag under weight, by conjugate gradients; without convergence the result is too
    high.

    Args:
        mesh: the body; as in Bullet, all nodes have the same mass.
        free: 1 for free nodes, 0 for anchored nodes (at least one), shape (n,).
        material: linearised.
    """
    stiffness = _stiffness_per_mass(mesh, free, material)
    load = free[:, None] * np.array([0.0, 0.0, 1.0])
    sag, rest = np.zeros_like(load), load
    direction, square = rest, float(np.vdot(rest, rest))
    least = _SAG_TOLERANCE**2 * square
    for _ in range(_SAG_ITERATIONS):
        if square <= least:
            break
        pushed = stiffness(direction)
        length = square / float(np.vdot(direction, pushed))
        sag, rest = sag + length * direction, rest - length * pushed
        before, square = square, float(np.vdot(rest, rest))
        direction = rest + square / before * direction
    return sqrt(float(np.vdot(sag, load) / np.vdot(sag, sag)))


def patch_stiffness(mesh: TetMesh, patch: NDArray[np.bool_], material: Material) -> float:
    """Return the largest stiffness (N/m) against a common motion of some nodes while the others stay.

    Args:
        mesh: the body at rest.
        patch: the nodes that move, shape (n,).
        material: linearised.
    """
    moving = patch.astype(np.float64)
    node_mass = material.density * volumes(mesh.nodes, mesh.tetrahedra).sum() / len(mesh.nodes)
    stiffness = _stiffness_per_mass(mesh, moving, material)
    forces = np.stack([stiffness(moving[:, None] * axis).sum(axis=0) for axis in np.eye(3)])
    return float(np.linalg.eigvalsh(node_mass * 0.5 * (forces + forces.T))[-1])


def _stiffness_per_mass(mesh: TetMesh, free: Vector, material: Material) -> Callable[[Vector], Vector]:
    """Return the map from displacements, shape (n, 3), to elastic forces divided by the mass of a node.

    In 1/s^2; arguments as in `highest_frequency`.
    """
    edges = mesh.nodes[mesh.tetrahedra[:, 1:]] - mesh.nodes[mesh.tetrahedra[:, :1]]  # (m, 3, 3)
    inverse = np.linalg.inv(edges)  # (m, 3, 3): the columns are the gradients of the shape functions 1 to 3
    # (m, 4, 3): of all four shape functions
    gradients = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2).transpose(0, 2, 1)
    volume = volumes(mesh.nodes, mesh.tetrahedra)
    mu, lambda_ = material.lame
    node_mass = material.density * volume.sum() / len(mesh.nodes)

    weighted = gradients * (volume / node_mass)[:, None, None]

    def stiffness(displacement: Vector) -> Vector:
        slope = displacement[mesh.tetrahedra].transpose(0, 2, 1) @ gradients  # displacement gradient
        stress = mu * (slope + slope.transpose(0, 2, 1))
        pressure = lambda_ * (slope[:, 0, 0] + slope[:, 1, 1] + slope[:, 2, 2])
        for i in range(3):
            stress[:, i, i] += pressure
        forces = weighted @ stress  # which is symmetric
        return (
            np.stack(
                [
                    np.bincount(mesh.tetrahedra.ravel(), forces[..., i].ravel(), len(mesh.nodes))
                    for i in range(3)
                ],
                axis=1,
            )
            * free[:, None]
        )

    return stiffness
