"""A half-space of tissue under a sphere, also deep, and under a point force.

The law of the sphere is Hertz's (Johnson, Contact Mechanics, 1985, section 4.2) times a share: the force of
converged finite elements of Bullet's neo-Hookean material, without friction, over Hertz's. The share falls as
the contact is no longer small beside the sphere. `python bench/tissue_truth.py law` computes the shares from
1.2 radii on; shares for smaller depths are from an earlier study, within 0.4 percent of the bench.
"""

from __future__ import annotations

import numpy as np

from engines.tissue.material import Material
from schemas.vectors import Vector

__all__ = [
    "DEEPEST",
    "POISSON_RATIOS",
    "patch_compliance",
    "point_displacement",
    "point_stress",
    "point_traction",
    "sphere_force",
]

DEEPEST = 2.5
"""Largest depth of the law, in radii; the material itself gives way under a sphere not far beyond
(docs/decisions/0095-converged-truth.md).
"""

POISSON_RATIOS = (0.3, 0.4, 0.45)
"""Poisson ratios of the table; shares are interpolated in between, and taken from the nearest beyond."""

_TABLE: Vector = np.array(
    [
        [0.00, 1.0000, 1.0000, 1.0000],
        [0.02, 0.9841, 0.9818, 0.9812],
        [0.05, 0.9874, 0.9809, 0.9784],
        [0.10, 0.9901, 0.9821, 0.9763],
        [0.15, 0.9868, 0.9765, 0.9693],
        [0.20, 0.9833, 0.9724, 0.9643],
        [0.30, 0.9754, 0.9611, 0.9520],
        [0.40, 0.9665, 0.9502, 0.9398],
        [0.50, 0.9568, 0.9393, 0.9273],
        [0.60, 0.9469, 0.9280, 0.9145],
        [0.80, 0.9255, 0.9035, 0.8886],
        [1.00, 0.9026, 0.8781, 0.8615],
        [1.20, 0.8785, 0.8534, 0.8372],
        [1.40, 0.8534, 0.8267, 0.8088],
        [1.60, 0.8272, 0.7990, 0.7796],
        [1.80, 0.8001, 0.7706, 0.7499],
        [2.00, 0.7725, 0.7416, 0.7194],
        [2.20, 0.7445, 0.7121, 0.6884],
        [2.40, 0.7164, 0.6826, 0.6571],
        [2.60, 0.6887, 0.6527, 0.6266],
        [2.80, 0.6618, 0.6239, 0.5943],
        [3.00, 0.6362, 0.5953, 0.5623],
    ]
)
"""Depth in radii, then the share of Hertz's force for every Poisson ratio."""

_DEPTHS, _SHARES = _TABLE[:, 0], _TABLE[:, 1:].T

_HIGHEST_OVER_PLANE = -0.5
"""Upper end of the fields of a point force: height over the tangent plane, in distances from the point. The
fields are singular on the axis above the point.
"""


def sphere_force(depth: Vector, radius: float, material: Material) -> Vector:
    """Return the force (N) of a sphere of `radius` (m) at every `depth` (m, up to 2.5 radii)."""
    nu = material.poisson_ratio
    row = float(np.interp(nu, POISSON_RATIOS, range(len(POISSON_RATIOS))))
    low = min(int(row), len(POISSON_RATIOS) - 2)
    shares: Vector = _SHARES[low] + (row - low) * (_SHARES[low + 1] - _SHARES[low])
    plane_strain = material.young_modulus / (1.0 - nu**2)
    hertz: Vector = 4.0 / 3.0 * plane_strain * np.sqrt(radius) * depth**1.5
    return hertz * np.interp(depth / radius, _DEPTHS, shares)


def patch_compliance(radius: float, material: Material) -> tuple[float, float]:
    """Return the displacement (m) of a held round patch under 1 N: along the normal, and across.

    Along: (1 - 2 nu) / (4 G a log(3 - 4 nu)), a sticking punch (Spence, Proceedings of the Royal Society A
    305, 1968); across: (2 - nu) / (8 G a) (Johnson, Contact Mechanics, 1985, section 7.2).
    """
    nu, shear = material.poisson_ratio, material.lame[0]
    along = (1.0 - 2.0 * nu) / (4.0 * shear * radius * np.log(3.0 - 4.0 * nu))
    return float(along), (2.0 - nu) / (8.0 * shear * radius)


def point_displacement(away: Vector, inward: Vector, material: Material) -> Vector:
    """Return the displacement (m) by 1 N at a point of the surface of a half-space, shape (n, 3).

    Boussinesq's solution: Johnson, Contact Mechanics (1985), section 3.2. away: displacement from the point,
    m, shape (n, 3). inward: direction of the force, into the half-space, shape (3,).
    """
    nu, shear = material.poisson_ratio, material.lame[0]
    R, depth, across, above = _cylindrical_coordinates(away, inward)
    along = depth**2 / R**3 + 2.0 * (1.0 - nu) / R
    out = depth / R**3 - (1.0 - 2.0 * nu) / (R * above)
    return (along[:, None] * inward + out[:, None] * across) / (4.0 * np.pi * shear)


def point_stress(away: Vector, inward: Vector, material: Material) -> Vector:
    """Return the stress (Pa) by 1 N at a point of the surface of a half-space, shape (n, 3, 3).

    Arguments and source: see `point_displacement`.
    """
    free = 1.0 - 2.0 * material.poisson_ratio
    R, depth, across, above = _cylindrical_coordinates(away, inward)
    radius = np.linalg.norm(across, axis=1)
    outward = across / np.maximum(radius, 1e-12)[:, None]
    hoop_line = np.cross(inward, outward)
    z, r = depth, radius
    radial = free / (R * above) - 3.0 * r**2 * z / R**5
    hoop = free * (z / R**3 - 1.0 / (R * above))
    axial, shear = -3.0 * z**3 / R**5, -3.0 * r * z**2 / R**5
    mixed = np.einsum("ni,j->nij", outward, inward)
    stress = (
        radial[:, None, None] * np.einsum("ni,nj->nij", outward, outward)
        + hoop[:, None, None] * np.einsum("ni,nj->nij", hoop_line, hoop_line)
        + axial[:, None, None] * np.multiply.outer(inward, inward)
        + shear[:, None, None] * (mixed + mixed.transpose(0, 2, 1))
    )
    return stress / (2.0 * np.pi)


def point_traction(away: Vector, inward: Vector, areas: Vector, material: Material) -> Vector:
    """Return the force (N) by `point_stress` on oriented areas (m^2), both of shape (n, 3).

    Other arguments and source: see `point_displacement`.
    """
    free = 1.0 - 2.0 * material.poisson_ratio
    R, z, across, above = _cylindrical_coordinates(away, inward)
    square = np.maximum(np.einsum("ni,ni->n", across, across), 1e-24)
    radial = free / (R * above) - 3.0 * square * z / R**5
    hoop = free * (z / R**3 - 1.0 / (R * above))
    axial, shear = -3.0 * z**3 / R**5, -3.0 * z**2 / R**5  # shear over the radius
    along, out = areas @ inward, np.einsum("ni,ni->n", across, areas)
    on_axis = (axial - hoop) * along + shear * out
    off_axis = (radial - hoop) * out / square + shear * along
    force = hoop[:, None] * areas + on_axis[:, None] * inward + off_axis[:, None] * across
    return force / (2.0 * np.pi)


def _cylindrical_coordinates(away: Vector, inward: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Return distance R, depth z, the vector across the axis, and R + z, all in m."""
    R = np.linalg.norm(away, axis=1)
    depth = away @ inward
    across = away - depth[:, None] * inward
    depth = np.maximum(depth, _HIGHEST_OVER_PLANE * R)
    return R, depth, across, R + depth
