"""Where a sphere touches a surface, and which of its nodes bear the force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engines.tissue.elasticity.body_yield import BodyYield
from engines.tissue.elasticity.compliance import SurfaceCompliance
from engines.tissue.elasticity.dense_body_yield import DenseBodyYield
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.organs.body import Body
from engines.tissue.probes.near_faces import BAND_M, NearFaces, closest_points
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["Place", "Surface", "find_place", "shares_of"]


class Surface:
    """The surface of an anchored organ at rest under its weight, with compliance."""

    def __init__(
        self,
        organ: Body,
        material: Material,
        body_yield: type[DenseBodyYield | BodyYield] = DenseBodyYield,
    ) -> None:
        """`organ`: a settled organ; `body_yield`: solver of its compliance."""
        self.organ, self.material = organ, material
        self.settled = organ.nodes
        """m, shape (n, 3)."""
        self.compliance = SurfaceCompliance(
            organ.mesh, organ.anchored, organ.touchable, material, body_yield=body_yield
        )


@dataclass(frozen=True)
class Place:
    """Where a sphere touches a surface, or is about to."""

    surface: Surface
    nodes: Indices
    """Nodes of the faces, shape (k,)."""
    parts: Vector
    """Parts of the force on each node, shape (k,), with sum 1."""
    first_parts: Vector
    """Parts at the beginning of the force: the sphere touches a single face, shape (k,)."""
    point: Vector
    """Point of the settled surface, m, shape (3,)."""
    inward: Vector
    """Normal of the surface into the tissue, shape (3,)."""
    distance: float
    """Distance of the sphere's centre from the nearest face, m."""


def find_place(surface: Surface, near: NearFaces, radius: float) -> Place:
    """Return the place of a sphere of `radius` (m) near these faces."""
    _, faces, weights, distances = near
    share = shares_of(distances, radius)
    weighted = (share / share.sum())[:, None] * weights
    corners = surface.settled[faces]
    areas = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = share @ (areas / np.sqrt((areas * areas).sum(axis=1))[:, None])
    point = np.einsum("fa,fai->i", weighted, corners)
    at, away = closest_points(point, corners)
    first = int(away.argmin())
    nodes, numbers = np.unique(faces, return_inverse=True)
    numbers: Indices = numbers.reshape(-1, 3)
    return Place(
        surface,
        nodes,
        _summed(numbers, weighted, len(nodes)),
        _summed(numbers[first], at[first], len(nodes)),
        point,
        -normal / np.sqrt(normal @ normal),
        float(distances.min()),
    )


def shares_of(distances: Vector, radius: float) -> Vector:
    """Return the share of each face (shape (f,)) in the force, by its distance from the centre, m."""
    share = np.maximum(radius + BAND_M - distances, 0.0)
    if not share.any():
        share[distances.argmin()] = 1.0
    return share


def _summed(numbers: Indices, parts: Vector, count: int) -> Vector:
    """Return the sum of the parts of each number below `count`, shape (count,)."""
    sums = np.zeros(count)
    np.add.at(sums, numbers, parts)
    return sums
