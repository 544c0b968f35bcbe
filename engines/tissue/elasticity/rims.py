"""The sharp edges of a body, and their share of the force of a half-space.

A sphere near a rim presses a quarter-space. At equal depth the force is the half-space's times a share, from
converged finite elements of Bullet's material (`python bench/tissue_truth.py rim`): two faces at a right
angle, no friction, the force along the normal of the pressed face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices
from schemas.vectors import Vector

__all__ = ["MIRRORED", "RimWatch", "Rims", "mirror_displacement", "rim_share", "rims_of"]

_LEAST_TURN = np.pi / 3
"""Least angle between the normals of two faces at a rim; the facets of round organs with 250 nodes turn by
less.
"""

_DIAGONAL = 1.415
"""Diagonal of a square over its side, rounded up."""

MIRRORED = 1.49
"""Effect of a rim on the displacement by a point force, as a number of forces at the mirror image (Guilbault,
Journal of Tribology 133, 2011, 031402, for a right angle and Poisson ratio 0.4).
"""

_AWAY = np.array([0.0, 0.3, 0.6, 1.0])
"""Distance of the sphere's axis from the rim, in radii."""
_DEPTHS = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.2])
"""Depths, in radii."""
_SHARES: Vector = np.array(
    [
        [0.4468, 0.4665, 0.4840, 0.4966, 0.4966, 0.4966],
        [0.6123, 0.5930, 0.5892, 0.5946, 0.6004, 0.6049],
        [0.7232, 0.6821, 0.6682, 0.6660, 0.6667, 0.6707],
        [0.8025, 0.7629, 0.7437, 0.7355, 0.7336, 0.7352],
    ]
)
"""Share of the half-space's force, by distance from the rim, then by depth; Poisson ratio 0.4. On the rim
computed up to 0.8 radii, and constant beyond.
"""


def rim_share(away: float, depths: Vector) -> Vector:
    """Return the share of the half-space's force near a rim, at every depth.

    `away`, the distance of the sphere's axis from the rim, and `depths` are in radii.
    """
    row = float(np.interp(away, _AWAY, range(len(_AWAY))))
    low = min(int(row), len(_AWAY) - 2)
    shares: Vector = _SHARES[low] + (row - low) * (_SHARES[low + 1] - _SHARES[low])
    return np.interp(depths, _DEPTHS, shares)


def mirror_displacement(away: Vector, material: Material) -> Vector:
    """Return the displacement (m) of a point under 1 N by the rim, in excess of the half-space's.

    away: displacement of the point from the rim, m; the mirror image is twice as far. Boussinesq's solution:
    Johnson, Contact Mechanics (1985), section 3.2.
    """
    plane_strain = material.young_modulus / (1.0 - material.poisson_ratio**2)
    return MIRRORED / (np.pi * plane_strain * 2.0 * away)


@dataclass(frozen=True)
class Rims:
    """The sharp edges of a surface; the sides of an edge are the two adjacent faces."""

    ends: Indices
    """Two nodes of each, shape (k, 2)."""
    outward: Vector
    """Normal of the face on each side, shape (k, 2, 3)."""
    across: Vector
    """Unit vectors in the plane of each face, out over the rim, shape (k, 2, 3)."""

    def vectors(self, point: Vector, nodes: Vector) -> Vector:
        """Return the way from `point` (m) to the nearest point of each rim, shape (k, 3).

        nodes: m, shape (n, 3).
        """
        a, b = nodes[self.ends[:, 0]] - point, nodes[self.ends[:, 1]] - point
        edge = b - a
        along = -np.einsum("ki,ki->k", a, edge) / np.einsum("ki,ki->k", edge, edge)
        return a + np.clip(along, 0.0, 1.0)[:, None] * edge

    def near(
        self, centre: Vector, inward: Vector, nodes: Vector, reach: float
    ) -> tuple[float, Vector] | None:
        """Return the distance (m) of a sphere's axis from the nearest rim, and the direction of pressing.

        Negative: beyond the rim, pressing from the centre towards the rim; positive: pressing along the
        face's normal. None: no rim within `reach`.

        Args:
            centre: centre of the sphere, m, shape (3,).
            inward: approximate direction into the pressed face, shape (3,).
            nodes: nodes of the mesh, m, shape (n, 3).
            reach: largest distance, m.
        """
        ways, facing = self.vectors(centre, nodes), -self.outward @ inward
        sides = facing.argmax(axis=1)
        outward = self.outward[np.arange(len(sides)), sides]
        heights = np.einsum("ki,ki->k", ways, outward)
        flat = ways - heights[:, None] * outward
        distances = np.sqrt((flat * flat).sum(axis=1))
        distances[(facing.max(axis=1) < np.cos(_LEAST_TURN)) | (np.abs(heights) > reach)] = np.inf
        nearest = int(distances.argmin())
        if distances[nearest] > reach:
            return None
        outwards, across = outward[nearest], self.across[nearest, sides[nearest]]
        away = float(np.copysign(distances[nearest], ways[nearest] @ across))
        press = -max(-heights[nearest], 0.0) * outwards + min(away, 0.0) * across
        return away, press / np.sqrt(press @ press) if away < 0.0 else -outwards


class RimWatch:
    """The rims near a sphere that goes along a surface: looked for only where there may be some."""

    def __init__(self, rims: Rims, nodes: Vector, reach: float) -> None:
        """`nodes`: of the mesh, m, shape (n, 3); `reach`: largest distance, m."""
        self._rims, self._nodes, self._reach = rims, nodes, reach
        self._looked_at: Vector = np.zeros(3)
        self._clear = 0.0
        """How far around `_looked_at` no rim can be near, m."""

    def near(self, centre: Vector, inward: Vector) -> tuple[float, Vector] | None:
        """Return the distance (m) from the nearest rim and the direction of pressing, as `Rims.near`."""
        x, y, z = (centre - self._looked_at).tolist()
        if x * x + y * y + z * z < self._clear * self._clear:
            return None
        found = self._rims.near(centre, inward, self._nodes, self._reach)
        if found is None:
            ways = self._rims.vectors(centre, self._nodes)
            nearest = float(np.sqrt((ways * ways).sum(axis=1)).min())
            # farther than this, along the face or from it a rim is beyond the reach
            self._looked_at, self._clear = centre, max(nearest - _DIAGONAL * self._reach, 0.0)
        return found


def rims_of(nodes: Vector, faces: Indices) -> Rims:
    """Return the edges where two of the faces, shape (f, 3), meet at a sharp convex angle."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort(ends.T[::-1])
    pairs = np.flatnonzero((ends[order][1:] == ends[order][:-1]).all(axis=1))
    sides = np.stack([order[pairs], order[pairs + 1]], axis=1)  # (e, 2): places among the faces' edges
    corners = nodes[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    outward = normals[sides // 3]
    ends = ends[sides[:, 0]]
    start, edge = nodes[ends[:, 0]], nodes[ends[:, 1]] - nodes[ends[:, 0]]
    inner = nodes[faces[sides // 3, (sides + 2) % 3]] - start[:, None]  # to the corner off the edge
    across = np.cross(edge[:, None], outward)
    across *= -np.sign(np.einsum("esi,esi->es", across, inner))[..., None]
    across /= np.linalg.norm(across, axis=2)[..., None]
    turned = np.einsum("ei,ei->e", outward[:, 0], outward[:, 1]) < np.cos(_LEAST_TURN)
    convex = np.einsum("ei,ei->e", outward[:, 0], inner[:, 1]) < 0.0
    sharp = turned & convex
    return Rims(ends[sharp], outward[sharp], across[sharp])
