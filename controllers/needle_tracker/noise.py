"""How wrong what is seen of a needle may be: anew in each picture, or alike in many.

A wire is brighter on the side of the lamp, so what is seen of it is drawn aside, by the same way in both eyes
and from picture to picture; a filter that takes such errors for independent ones becomes too sure. Here they
are common errors of a picture, few numbers, not estimated. A share of the wire's width that
is not seen says by how much more the middle of the rest may be aside.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, pi, sqrt

import numpy as np

from schemas.vectors import Vector

__all__ = ["PIECES", "LastingNoise", "Noise"]

PIECES = 24
"""Pieces of the wire; the distances of a piece are averaged."""
_LASTS = 25
"""Pictures in which an error that lasts is the same: those of a second.

In that time a held needle drifts by about as much (0.2 mm) as such errors displace an estimate.
"""
_MODES = 5
"""Slow changes along the wire: as many as can be taken for displacement, distance and tilt."""
_SAMPLED = 0.5
"""px of a wire's width that may be missing by the sampling of pixels alone."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of what is seen, px or shares of the wire's width."""

    arc: float = 0.3
    """px: of the centre line, along its normal, at each pixel of its length, anew in each picture."""
    tip: float = 0.5
    """px: of the tip, in either direction, anew in each picture."""
    lasting: float = 0.0
    """px: of what lasts, and changes slowly along the wire."""
    shading: float = 0.0
    """Displacement of the whole wire towards the lit side, as a share of the wire's width; lasting."""
    capping: float = 0.0
    """Displacement of the seen tip, partly hidden by wire and light, likewise."""

    def of_pieces(self, seen: Vector, expected: Vector, width: float) -> Vector:
        """Return the variances, px^2, of pieces of which such lengths (px) are seen and expected."""
        missing = 0.5 * np.maximum(0.0, (1.0 - seen / expected) * width - _SAMPLED)
        # the middle of what is left is anywhere within `missing` of that of the wire
        return self.arc**2 / np.maximum(seen, 1e-9) + _LASTS * missing**2 / 3.0

    def lasting_noise(self, width: float) -> LastingNoise:
        """Return what lasts, for a single picture in which the wire is `width` px wide.

        The same error in `_LASTS` pictures is taken for as many independent ones, each larger.
        """
        often = sqrt(_LASTS)
        return LastingNoise(often * self.lasting, often * self.shading * width, often * self.capping * width)


@dataclass(frozen=True)
class LastingNoise:
    """Errors that all of a picture has in common: standard deviations, px.

    They are combinations of independent numbers of variance 1: a displacement in the picture, slow changes
    along the wire, and what the tip has beside.
    """

    slow: float
    shift: float
    cap: float

    @property
    def wire(self) -> float:
        """Of the wire, along its normal."""
        return hypot(self.slow, self.shift)

    @property
    def tip(self) -> float:
        """Of the tip, in either direction."""
        return hypot(self.shift, self.cap)

    def of_wire(self, normals: Vector) -> Vector:
        """Return how each piece combines the numbers, shape (pieces, k); `normals`, (pieces, 2): its own."""
        return np.hstack([self.shift * normals, self.slow * _SLOW, np.zeros((PIECES, 2))])

    def of_tip(self) -> Vector:
        """Return how the tip combines them, shape (2, k)."""
        return np.hstack([self.shift * np.eye(2), np.zeros((2, _MODES)), self.cap * np.eye(2)])


def _slow_changes() -> Vector:
    """Return changes along the wire, shape (pieces, modes), whose squares add up to 1 in the mean."""
    along = (np.arange(PIECES) + 0.5) / PIECES
    modes = np.cos(pi * np.outer(along, np.arange(_MODES)))
    modes[:, 1:] *= sqrt(2.0)
    return modes / sqrt(_MODES)


_SLOW = _slow_changes()
