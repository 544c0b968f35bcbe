"""Elastic constants: from Young's modulus to what Bullet's neo-Hookean model takes, and what a time step can bear."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from engines.bullet.mesh import TetMesh, volumes
from schemas.vectors import Vector

__all__ = ["Material", "highest_frequency", "longest_step"]

_POWER_ITERATIONS = 200

_LARGEST_PHASE = 4.0
"""Largest timestep x highest frequency: a block pressed at a node is steady at 4.0 and chatters at 4.7 (tests/engines/test_bullet_limits.py)."""


@dataclass(frozen=True)
class Material:
    """An isotropic elastic material with stiffness-proportional damping."""

    young_modulus: float
    """E, Pa."""
    poisson_ratio: float
    density: float
    """kg/m^3."""
    damping: float
    """Ratio of the damping matrix to the stiffness matrix, s."""

    @property
    def lame(self) -> tuple[float, float]:
        """The Lame parameters (mu, lambda), Pa."""
        e, nu = self.young_modulus, self.poisson_ratio
        return e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def bullet_lame(self) -> tuple[float, float]:
        """What Bullet must be given for as mu and lambda (Pa) so that small strains obey `lame`.

        Bullet has the energy of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (ACM Trans. Graph. 37, 2018),
        whose section 3.4 shows that its linearisation needs 4/3 mu and lambda + 5/6 mu.
        """
        mu, lambda_ = self.lame
        return 4.0 / 3.0 * mu, lambda_ + 5.0 / 6.0 * mu

    def contact_stiffness(self, radius: float) -> float:
        """Return the stiffness (N/m) against a flat round punch of `radius` (m) on a half-space, 2 E radius / (1 - nu^2).

        Johnson, Contact Mechanics (1985), section 3.4; for a sphere it is the tangent stiffness where the contact has that radius.
        """
        return 2.0 * self.young_modulus * radius / (1.0 - self.poisson_ratio**2)


def highest_frequency(mesh: TetMesh, free: Vector, material: Material) -> float:
    """Return the highest natural frequency (rad/s) of the mesh about its resting shape.

    Args:
        mesh: the body; as in Bullet, all its nodes have the same mass.
        free: 1 for nodes that can move, 0 for anchored ones, shape (n,).
        material: linearised.
    """
    edges = mesh.nodes[mesh.tetrahedra[:, 1:]] - mesh.nodes[mesh.tetrahedra[:, :1]]  # (m, 3, 3)
    inverse = np.linalg.inv(edges)  # (m, 3, 3): the columns are the gradients of the shape functions 1 to 3
    gradients = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2).transpose(0, 2, 1)  # (m, 4, 3)
    volume = volumes(mesh.nodes, mesh.tetrahedra)
    mu, lambda_ = material.lame
    node_mass = material.density * volume.sum() / len(mesh.nodes)
    mode = np.random.default_rng(0).standard_normal(mesh.nodes.shape) * free[:, None]
    square = 0.0
    for _ in range(_POWER_ITERATIONS):
        mode /= np.linalg.norm(mode)
        slope = np.einsum("mai,maj->mij", mode[mesh.tetrahedra], gradients)  # displacement gradient
        trace = np.einsum("mii->m", slope)
        stress = mu * (slope + slope.transpose(0, 2, 1)) + lambda_ * trace[:, None, None] * np.eye(3)
        forces = np.einsum("m,mij,maj->mai", volume, stress, gradients) / node_mass
        mode = np.stack([np.bincount(mesh.tetrahedra.ravel(), forces[..., i].ravel(), len(mesh.nodes)) for i in range(3)], axis=1) * free[:, None]
        square = float(np.linalg.norm(mode))
    return sqrt(square)


def longest_step(frequency: float, damping: float) -> float:
    """Return the longest stable time step (s) for Bullet's scheme: explicit elasticity, implicit damping, then position.

    For a mode of angular frequency w the scheme reads v' = (v - h w^2 x) / (1 + h d w^2), x' = x + h v'. Its roots leave the unit
    circle where h^2 w^2 > 4 + 2 h d w^2, so d >= h / 2 keeps any frequency stable. Contacts are solved before the damping, and
    chatter where h w is too large.
    """
    return min(damping + sqrt(damping**2 + 4.0 / frequency**2), _LARGEST_PHASE / frequency)
