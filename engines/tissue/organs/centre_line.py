"""A smooth centre line through points, and frames along it that do not twist."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["CentreLine", "smooth_through"]

_PIECES = 24
"""Straight pieces between two points of a line."""
_DOWN = np.array([0.0, 0.0, -1.0])


def smooth_through(points: Vector) -> Vector:
    """Return a curve through points of any dimension d, shape (k, d), by Catmull and Rom, shape (p, d)."""
    padded = np.concatenate([2.0 * points[:1] - points[1:2], points, 2.0 * points[-1:] - points[-2:-1]])
    u = (np.arange(_PIECES) / _PIECES)[:, None]
    parts: list[Vector] = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        cubic = 2.0 * b + (c - a) * u + (2.0 * a - 5.0 * b + 4.0 * c - d) * u * u
        parts.append(0.5 * (cubic + (3.0 * b - a - 3.0 * c + d) * u * u * u))
    return np.concatenate([*parts, points[-1:]])


@dataclass(frozen=True, eq=False)
class CentreLine:
    """A polyline with arc length."""

    points: Vector
    """Shape (p, 3), m."""

    @cached_property
    def stations(self) -> Vector:
        """Arc length at each point, m, shape (p,)."""
        lengths = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(lengths)])

    @property
    def length(self) -> float:
        """Length, m."""
        return float(self.stations[-1])

    def at(self, stations: Vector) -> Vector:
        """Return the places at arc lengths (m), shape (n, 3)."""
        return np.stack([np.interp(stations, self.stations, self.points[:, i]) for i in range(3)], axis=1)

    def frames(self, stations: Vector) -> tuple[Vector, Vector, Vector]:
        """Return the tangent and two sides at ascending arc lengths (m), shapes (n, 3).

        The first side begins as near to -z as it can; tangent x second side = first side.
        """
        ways = np.diff(self.points, axis=0)
        middles = 0.5 * (self.stations[1:] + self.stations[:-1])
        raw = np.stack(
            [np.interp(stations, middles, ways[:, i] / np.diff(self.stations)) for i in range(3)], 1
        )
        tangents: Vector = raw / np.linalg.norm(raw, axis=1, keepdims=True)
        start = _DOWN if abs(float(tangents[0, 2])) < 0.9 else np.array([1.0, 0.0, 0.0])
        sides: list[Vector] = []
        for tangent in tangents:
            side = (sides[-1] if sides else start) - float(
                (tangent * (sides[-1] if sides else start)).sum()
            ) * tangent
            sides.append(side / np.linalg.norm(side))
        firsts = np.array(sides)
        return tangents, firsts, cross(firsts, tangents)

    def nearest(self, points: Vector) -> tuple[Vector, Vector]:
        """Return arc length (m) and arm (m) of the nearest point of the line, shapes (n,) and (n, 3)."""
        off = points[:, None] - self.points
        best = (off * off).sum(axis=2).argmin(axis=1)
        return self.stations[best], off[np.arange(len(points)), best]
