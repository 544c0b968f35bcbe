"""A published distribution, and draws of it."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from statistics import NormalDist

__all__ = ["Spread"]

_DIGITS = 5
"""Digits of a draw: the last bits of a logarithm differ between processors."""


@dataclass(frozen=True)
class Spread:
    """A normal distribution between two limits, SI units."""

    mean: float
    deviation: float
    least: float
    most: float

    def draw(self, random: Random) -> float:
        """Return a value; the same for the same state of `random` on all platforms."""
        normal = NormalDist(self.mean, self.deviation)
        low, high = normal.cdf(self.least), normal.cdf(self.most)
        share = low + (high - low) * random.random()
        return round(normal.inv_cdf(min(max(share, 1e-9), 1.0 - 1e-9)), _DIGITS)
