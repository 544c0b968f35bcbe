"""A tube as the tissue reports it: where it lies, and how far along a place is."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from robots.polyline import nearest_feet
from schemas.trocar_msgs import TubeLine
from schemas.vectors import Vector

__all__ = ["Place", "Tube"]

_BESIDE = 2
"""Rings on each side of a ring between which a tube has a direction."""


class Place(NamedTuple):
    """A point beside a tube."""

    along: float
    """Distance from the tube's left end along the line at rest, m."""
    distance: float
    """Distance from the line, m."""
    direction: Vector
    """Unit vector along the tube, shape (3,)."""


class Tube:
    """Middle line of a tube at an instant."""

    def __init__(self, points: Vector, along: Vector, parted: NDArray[np.uint8]) -> None:
        """`points`: middles of rings, m, shape (k, 3); `along`: distances from the left end at rest, m, (k,).

        parted: 1 where the tube is parted between a ring and the next, shape (k,).
        """
        self._points, self._along, self._parted = points, along, parted

    @classmethod
    def read(cls, message: TubeLine) -> Self | None:
        """Return the tube of a message; None: the message has no line of finite numbers."""
        points, along, parted = message.points_m, message.along_m, message.parted
        count = len(along)
        if count < 2 or points.size != 3 * count or parted.size != count:
            return None
        if not (np.isfinite(points).all() and np.isfinite(along).all()):
            return None
        return cls(points.reshape(-1, 3), along, parted)

    @property
    def length(self) -> float:
        """Length at rest, m."""
        return float(self._along[-1])

    def place(self, point: Vector) -> Place:
        """Return the place of a point, m, in `world`, shape (3,)."""
        shares, off = nearest_feet(self._points, point)
        off[self._parted[:-1] > 0] = np.inf  # no tissue there
        ring = int(off.argmin())
        along = self._along[ring] + shares[ring] * (self._along[ring + 1] - self._along[ring])
        return Place(float(along), float(off[ring]), self._direction(ring))

    def _direction(self, ring: int) -> Vector:
        last = len(self._points) - 1
        way: Vector = self._points[min(ring + 1 + _BESIDE, last)] - self._points[max(ring - _BESIDE, 0)]
        return way / max(float(np.linalg.norm(way)), 1e-12)
