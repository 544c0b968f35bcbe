"""The natural frequencies of a mesh, and the longest time step in Bullet."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from engines.bullet.elasticity.material import Material
from engines.bullet.meshing.tet_mesh import TetMesh, volumes
from schemas.vectors import Vector

__all__ = ["ACCURATE_PHASE", "face_loss", "highest_frequency", "longest_step", "lowest_frequency"]

_POWER_ITERATIONS = 200

_SAG_ITERATIONS, _SAG_TOLERANCE = 300, 0.1
"""Limits of conjugate gradients for the sag: enough for the lowest frequency to one percent."""

_LARGEST_PHASE = 4.0
"""Largest timestep x highest frequency.

A block pressed at a node is stable at 4.0 and chatters at 4.7 (elasticity/test_limits.py in the tests).
"""


ACCURATE_PHASE = 1.7
"""Largest timestep x highest frequency for a contact force within 10 %."""
_FACE_COMPLIANCE = 0.042
"""Extra relative sinking of a sphere into a face at a phase of 1, growing with the square of the phase. On
coarse meshes; with 250 nodes 0.031 (`bench/tissue_step.py`).
"""


def face_loss(phase: float) -> float:
    """Return the largest relative loss of force of a contact in a face of the mesh.

    `phase`: timestep x highest frequency. Contacts at nodes lose next to nothing, held nodes nothing.
    """
    sinking = _FACE_COMPLIANCE * phase**2
    return sinking / (1.0 + sinking)


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


def longest_step(frequency: float, damping: float) -> float:
    """Return the longest stable time step (s) of Bullet's integration scheme.

    The scheme is explicit in elasticity and implicit in damping, then moves the positions. For a mode of
    angular frequency w: v' = (v - h w^2 x) / (1 + h d w^2), x' = x + h v'. The roots leave the unit circle at
    h^2 w^2 > 4 + 2 h d w^2, so d >= h / 2 keeps any frequency stable. Contacts are solved before the damping,
    and chatter at too large an h w.
    """
    return min(damping + sqrt(damping**2 + 4.0 / frequency**2), _LARGEST_PHASE / frequency)
