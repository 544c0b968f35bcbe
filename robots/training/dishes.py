"""Dishes and small pieces of the authors' pick-and-place scene: numbers with sources. SI units.

The scene's frame is on the table, amid the three dishes: x to the surgeon's right, y away from the surgeon, z
up. The frame of a dish is in the middle of the underside, z up; the frame of a piece is in the piece's
middle.

Source: unina-icaros/dvrk-vrep (commit 88fe597), dVRK-training_pick&place.ttt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

__all__ = ["DISH", "DISHES", "PIECE", "Dish", "Piece"]


@dataclass(frozen=True)
class Dish:
    """A round dish with an upright rim."""

    outer_radius: float
    """m."""
    inner_radius: float
    """m."""
    height: float
    """Height of the rim over the table, m."""


@dataclass(frozen=True)
class Piece:
    """A small block to be carried from dish to dish."""

    size: tuple[float, float, float]
    """Along x, y and z, m."""
    mass: float
    """kg."""
    friction: float
    """Coefficient of Coulomb friction."""


DISH = Dish(outer_radius=29.85e-3, inner_radius=28.8e-3, height=21.9e-3)
"""Cylinder, Cylinder0 and Cylinder1: 59.7 mm wide, inner radius 28.8 mm, 21.9 mm high, 1 kg each. Here dishes
are fixed and have no floor: pieces inside lie on the table.
"""

DISHES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"left": (-0.054, -0.013), "middle": (0.0, 0.026), "right": (0.054, -0.013)}
)
"""x and y (m) of each dish in the scene's frame: Cylinder at (-1.458, -0.051), Cylinder0 at (-1.419, 0.003)
and Cylinder1 at (-1.457, 0.057) on the authors' table; the table's y is our x.
"""

PIECE = Piece(size=(9.0e-3, 14.0e-3, 20.5e-3), mass=0.289e-3, friction=1.0)
"""Water1 to Water6: 0.289 g there, in a bounding box of 2.6 cm^3. Friction as of all objects
(docs/decisions/0012): the authors' pieces are held by no contact.
"""
