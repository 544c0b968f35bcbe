"""Mass, centre and inertia tensor of a body. SI units."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from schemas.vectors import Vector

__all__ = ["STEEL_DENSITY", "Inertia"]

STEEL_DENSITY = 7900.0
"""Stainless steel 1.4301 (AISI 304), kg/m^3 (EN 10088-1, physical properties: 7.9 kg/dm^3)."""


@dataclass(frozen=True)
class Inertia:
    """Mass (kg), centre of mass (m), shape (3,), inertia tensor about the centre (kg m^2), shape (3, 3)."""

    mass: float
    centre: Vector
    tensor: Vector

    @classmethod
    def of_box(cls, mass: float, centre: Vector, size: Vector) -> Inertia:
        """Return the inertia of a uniform box of `size` (m), shape (3,), parallel to the axes."""
        return cls(mass, centre, mass / 12.0 * np.diag(size @ size - size * size))

    @classmethod
    def of_rod(cls, mass: float, start: Vector, end: Vector, radius: float) -> Inertia:
        """Return the inertia of a thin tube from `start` to `end` (m), shape (3,).

        For `start` = `end`: the inertia of a ring without direction.
        """
        along = np.outer(end - start, end - start)
        length_squared = np.trace(along)
        axis = along / (length_squared or 1.0)
        across = mass * (length_squared / 12.0 + radius**2 / 2.0)
        return cls(mass, (start + end) / 2.0, across * (np.eye(3) - axis) + mass * radius**2 * axis)

    @classmethod
    def of_ball(cls, mass: float, centre: Vector, radius: float) -> Inertia:
        """Return the inertia of a solid ball of `radius` (m)."""
        return cls(mass, centre, 0.4 * mass * radius**2 * np.eye(3))

    @classmethod
    def of_steel_ball(cls, centre: Vector, radius: float) -> Inertia:
        """Return the inertia of a solid ball of steel."""
        return cls.of_ball(STEEL_DENSITY * 4.0 / 3.0 * pi * radius**3, centre, radius)

    @property
    def pseudo_inertia(self) -> Vector:
        """Integral of r r^T over the mass, r = (x, y, z, 1), shape (4, 4).

        Positive definite if and only if a body can have this inertia.
        """
        result = np.empty((4, 4))
        result[:3, :3] = (
            np.trace(self.tensor) / 2.0 * np.eye(3)
            - self.tensor
            + self.mass * np.outer(self.centre, self.centre)
        )
        result[:3, 3] = result[3, :3] = self.mass * self.centre
        result[3, 3] = self.mass
        return result
