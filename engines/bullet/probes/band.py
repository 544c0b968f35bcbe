"""Stiffness of a mesh relative to its tissue, and range of the correcting spring, for each organ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engines.tissue.elasticity.compliance import SurfaceCompliance
from engines.tissue.elasticity.dense_body_yield import MOST_NODES
from engines.tissue.elasticity.half_space import DEEPEST, sphere_force
from engines.tissue.organs.params import OrganParams

__all__ = ["Band", "band"]

_DEPTH = 0.2
"""Depth of the press, in radii: the contact is smaller than a face, as assumed in the mesh's compliance."""

_TENTHS = (0.1, 0.9)
"""Quantiles of the ratios over all places in the report."""


@dataclass(frozen=True)
class Band:
    """How much stiffer a mesh is than its tissue under a sphere."""

    radius: float
    """m."""
    stiffer: tuple[float, float]
    """The mesh's force over the tissue's, `_DEPTH` deep, at a tenth and nine tenths of the places."""
    softer: float
    """Share of the places where the mesh is softer than the tissue: there the spring is rigid."""
    deepest: float
    """Largest depth with a known force of the tissue, m."""

    @property
    def mesh_alone(self) -> str:
        """Error of the mesh without the spring, in words."""
        low, high = self.stiffer
        softer = f", and softer than the tissue at {self.softer:.0%} of the places" if self.softer else ""
        return f"{low:.1f} to {high:.1f} times too stiff under a sphere of {self.radius * 1e3:g} mm{softer}"

    def __str__(self) -> str:
        return f"{self.mesh_alone}; mended for one sphere, up to {self.deepest * 1e3:g} mm deep"


def band(organ: OrganParams, radius: float) -> Band | None:
    """Return the band for a sphere of `radius` (m).

    None: no correction, for an organ of more than `MOST_NODES` nodes, or without anchors.
    """
    mesh, anchored = organ.rest, np.zeros(len(organ.rest.nodes), dtype=np.bool_)
    for tied in organ.anchored_nodes.values():
        anchored |= tied
    if len(mesh.nodes) > MOST_NODES or not anchored.any():
        return None
    faces = mesh.triangles[~anchored[mesh.triangles].all(axis=1)]
    compliance = SurfaceCompliance(mesh, anchored, faces, organ.elastic)
    depth, depths = _DEPTH * radius, np.linspace(0.0, DEEPEST * radius, 200)
    forces = sphere_force(depths, radius, organ.elastic)
    corners = mesh.nodes[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = -areas / np.sqrt((areas * areas).sum(axis=1))[:, None]

    def ratios() -> Iterator[float]:
        for face, direction in zip(faces, inward, strict=True):
            between = compliance.of_mesh(face, direction)
            for parts in (np.full(3, 1.0 / 3.0), *np.eye(3)[~anchored[face]]):
                tissue = np.interp(depth, depths + compliance.of_body(face, parts) * forces, forces)
                yield depth / float(parts @ between @ parts) / float(tissue)

    found = np.fromiter(ratios(), np.float64)
    low, high = np.quantile(found, _TENTHS).tolist()
    return Band(radius, (low, high), float((found < 1.0).mean()), DEEPEST * radius)
