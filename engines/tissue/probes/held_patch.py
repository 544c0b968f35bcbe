"""A spring in series with a jaw holding tissue: the missing compliance of the held nodes of a coarse mesh.

A jaw holds a patch as wide as its pad, the mesh some nodes, perhaps two pads apart. The compliance of a patch
of this width is known, and the compliance of the mesh between the held nodes too; both are linear, up to a
lift of three pads within 5 percent. The difference yields to the pull of all held spheres together. See
docs/decisions/0099-rims-and-held-patches.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from engines.tissue.elasticity.compliance import SurfaceCompliance
from engines.tissue.elasticity.half_space import patch_compliance
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.probes.params import Coupling
from schemas.vectors import Vector

__all__ = ["HeldPatch", "PatchCompliance", "patch_at"]

_ZETA = 0.3
"""Damping ratio of the proxies on the spring alone. A pull is delayed by some 10 ms; at a ratio of 1 by 40
ms, and a lift in 0.1 s then costs more than the tissue gives back.
"""


class PatchCompliance(NamedTuple):
    """Compliance of a patch of tissue around held nodes, in `world`."""

    missing: Vector
    """Compliance in excess of the mesh, m/N, shape (3, 3), symmetric; negative where the mesh is too soft."""
    mesh: Vector
    """Compliance of the mesh, m/N, shape (3, 3), symmetric."""


def patch_at(surface: SurfaceCompliance, material: Material, nodes: Indices, width: float) -> PatchCompliance:
    """Return the compliance of a patch at held nodes.

    Args:
        surface: surface of the organ.
        material: material of the tissue.
        nodes: held nodes with a common motion, shape (k,).
        width: width of the patch, m.
    """
    held = surface.on_surface(nodes)
    along, across = patch_compliance(0.5 * width, material)
    tissue: Vector = across * np.eye(3)
    for node, normal in zip(held.tolist(), surface.normals_at(held), strict=True):
        beyond = surface.of_body(np.array([node]), np.ones(1))
        tissue += (along + beyond - across) / len(held) * np.outer(normal, normal)
    between = surface.between(held)
    alike = np.tile(np.eye(3), (len(held), 1))
    found = np.asarray(np.linalg.inv(alike.T @ np.linalg.solve(between, alike)), np.float64)
    mesh: Vector = 0.5 * (found + found.T)
    return PatchCompliance(tissue - mesh, mesh)


class HeldPatch:
    """Spring and damper in series with a jaw holding tissue: their present yield.

    Without the damper the proxies would swing on the spring, as the coupling's spring moves with the proxies.
    """

    def __init__(self, spheres: Indices, coupling: Coupling, compliance: Vector) -> None:
        """Yield to the sum of the forces on the `spheres`, shape (k,), by `compliance` (m/N), shape (3, 3).

        Rigid in directions of negative compliance, as no spring in series stiffens.
        """
        self._spheres, self._coupling = spheres, coupling
        values, self._directions = np.linalg.eigh(compliance)
        self._compliances: Vector = np.maximum(values, 0.0)
        self.yielded: Vector = np.zeros(3)
        """m, in `world`, shape (3,)."""

    def give_way(self, springs: Vector, dampers: Vector, since: float, *, keep: bool) -> None:
        """Reduce the forces (N, shape (n, 3)) of a rigid coupling by the yield of the spring in series.

        since: time since the yield was last kept, s. Along each axis of the compliance C the yield s follows
        from s + C d s' = C f, with the damper d = 2 zeta sqrt(mass / C), the sum of the forces f = sum k (e -
        s) + b (e' - s') over the holding spheres, and s' = (s - s_before) / since.
        """
        coupling, at, count = self._coupling, self._spheres, len(self._spheres)
        compliances, directions = self._compliances, self._directions
        pull = (springs[at].sum(axis=0) + dampers[at].sum(axis=0)) @ directions
        rates = compliances * count * coupling.damping + 2.0 * _ZETA * np.sqrt(
            count * coupling.mass * compliances
        )
        rates /= since
        before = self.yielded @ directions
        along = (compliances * pull + rates * before) / (
            1.0 + compliances * count * coupling.stiffness + rates
        )
        yielded: Vector = directions @ along
        springs[at] -= coupling.stiffness * yielded
        dampers[at] -= coupling.damping / since * (yielded - self.yielded)
        if keep:
            self.yielded = yielded
