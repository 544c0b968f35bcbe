"""The force of a rigid sphere on a neo-Hookean half-space, at depths up to its diameter.

Hertz' law, 4/3 E / (1 - nu^2) sqrt(R) d^1.5 (Johnson, Contact Mechanics, 1985, section 4.2), times a share
that converged axisymmetric finite elements gave.
"""

from __future__ import annotations

import numpy as np

from schemas.vectors import Vector

__all__ = ["DEEPEST", "hertz", "share"]

DEEPEST = 2.0
"""Depth over radius up to which the shares are known."""

_RATIOS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0)
_POISSON_RATIOS = (0.3, 0.4, 0.45)
_SHARES: Vector = np.array(
    [
        [1, 0.9841, 0.9874, 0.9901, 0.9868, 0.9833, 0.9754, 0.9665, 0.9568]
        + [0.9469, 0.9255, 0.9026, 0.8782, 0.8528, 0.8260, 0.7982, 0.7694],
        [1, 0.9818, 0.9809, 0.9821, 0.9765, 0.9724, 0.9611, 0.9502, 0.9393]
        + [0.9280, 0.9035, 0.8781, 0.8518, 0.8243, 0.7959, 0.7663, 0.7356],
        [1, 0.9812, 0.9784, 0.9763, 0.9693, 0.9643, 0.9520, 0.9398, 0.9273]
        + [0.9145, 0.8886, 0.8615, 0.8335, 0.8047, 0.7746, 0.7434, 0.7109],
    ]
)
"""By Poisson ratio and depth over radius. Finite elements: neo-Hookean half-space, axisymmetric, refined until
two meshes agreed within 1 %; below a tenth of the radius that error is most of what they say.
"""


def hertz(depth: Vector, radius: float, young_modulus: float, poisson_ratio: float) -> Vector:
    """Return the force (N) by Hertz at `depth` (m, any shape); 0 above the surface. SI units."""
    modulus = young_modulus / (1.0 - poisson_ratio**2)
    return 4.0 / 3.0 * modulus * np.sqrt(radius) * np.maximum(depth, 0.0) ** 1.5


def share(ratio: Vector, poisson_ratio: float) -> Vector:
    """Return what part of Hertz' force is felt at depth over radius `ratio` (any shape).

    Outside the table, of Poisson ratios of 0.3 to 0.45 and ratios up to `DEEPEST`, its end is taken.
    """
    nu = float(np.clip(poisson_ratio, _POISSON_RATIOS[0], _POISSON_RATIOS[-1]))
    row = int(np.clip(np.searchsorted(_POISSON_RATIOS, nu), 1, len(_POISSON_RATIOS) - 1))
    low, high = _POISSON_RATIOS[row - 1 : row + 1]
    weight = (nu - low) / (high - low)
    shares = (1.0 - weight) * _SHARES[row - 1] + weight * _SHARES[row]
    return np.interp(ratio, _RATIOS, shares)
