"""A duct or vessel as a surgeon sees it: its present middle line. SI units, in the world."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.obstacles import Obstacles
from robots.polyline import nearest_feet
from schemas.trocar_msgs import TubeLine
from schemas.vectors import Vector

__all__ = ["Tube"]

_BESIDE = 2.0e-3
"""Distance along the tube, to both sides, over which its direction is measured, m."""

_ACROSS = 0.8
"""Cosine of the least angle between a tube and the view, where jaws can stand across it."""


class Tube:
    """The present line; places are distances along the line at rest, from the gallbladder's end."""

    def __init__(self, line: TubeLine) -> None:
        self.points: Vector = line.points_m.reshape(-1, 3)
        """Middles of the rings, m, shape (r, 3)."""
        self._along, self._diameters, self._parted = line.along_m, line.diameters_m, line.parted

    @property
    def length(self) -> float:
        """Length at rest, m."""
        return float(self._along[-1])

    @property
    def is_parted(self) -> bool:
        """Whether the tube is parted anywhere."""
        return bool(np.any(self._parted))

    @property
    def body(self) -> Obstacles:
        """The tube with its thickness, without the gaps where it is parted."""
        return Obstacles.line(self.points, self.radii, self._parted[:-1] == 0)

    @property
    def partings(self) -> Vector:
        """Places where the tube is parted, m, ascending."""
        at = np.flatnonzero(self._parted)
        return 0.5 * (self._along[at] + self._along[np.minimum(at + 1, len(self._along) - 1)])

    @property
    def slack(self) -> float:
        """Present length over the distance of the ends; 1: straight."""
        chord = float(np.linalg.norm(self.points[-1] - self.points[0]))
        present = float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())
        return present / max(chord, 1e-9)

    @property
    def radii(self) -> Vector:
        """Outer radius of each ring at rest, m, shape (r,)."""
        return 0.5 * self._diameters

    def point(self, along: float) -> Vector:
        """Return the present middle at a place, m, shape (3,)."""
        return np.array([np.interp(along, self._along, self.points[:, axis]) for axis in range(3)])

    def direction(self, along: float) -> Vector:
        """Return the present direction at a place, away from the gallbladder, shape (3,).

        It is measured on the piece of the tube with this place.
        """
        cuts = np.flatnonzero(self._parted)
        before, after = cuts[self._along[cuts] < along], cuts[self._along[cuts] >= along]
        first = self._along[before[-1] + 1] if before.size else self._along[0]
        last = self._along[after[0]] if after.size else self._along[-1]
        ends = np.clip([along - _BESIDE, along + _BESIDE], first, last)
        way = self.point(float(ends[1])) - self.point(float(ends[0]))
        return way / max(float(np.linalg.norm(way)), 1e-9)

    def hides(self, other: Tube, eye: Vector) -> bool:
        """Return whether this tube lies across the way from an eye (m, shape (3,)) to another tube."""
        ways = eye - other.points
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        off = self.points - other.points[:, None]
        ahead = (off * ways[:, None]).sum(axis=2)
        aside = np.linalg.norm(off - ahead[:, :, None] * ways[:, None], axis=2)
        reach = self.radii + other.radii[:, None]
        return bool(((ahead > reach) & (aside < reach)).any())

    def first_place(self, organ: Obstacles, gap: float, eye: Vector) -> float:
        """Return the first place that is free, and lies across the view, m; 0 without any.

        organ: surface that the wall is at least `gap` (m) away from. eye: m, shape (3,).
        """
        apart = organ.distances(self.points, gap + float(self.radii.max()) + _BESIDE) - self.radii
        ways = np.gradient(self.points, axis=0)
        views = eye - self.points
        lengths = np.linalg.norm(ways, axis=1) * np.linalg.norm(views, axis=1)
        foreshortened = np.abs((ways * views).sum(axis=1)) / np.maximum(lengths, 1e-12)
        good = np.flatnonzero((apart >= gap) & (foreshortened < _ACROSS))
        return float(self._along[good[0]]) if good.size else 0.0

    def nearest(self, point: Vector) -> float:
        """Return the place nearest to a point (m, shape (3,))."""
        shares, distances = nearest_feet(self.points, point)
        best = int(distances.argmin())
        share = float(shares[best])
        return float(self._along[best] + share * (self._along[best + 1] - self._along[best]))
