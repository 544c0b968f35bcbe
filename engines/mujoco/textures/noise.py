"""Smooth noise in space, the same on every machine for the same seed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CELLS", "SEED", "Noise", "Points", "Values"]

Points = NDArray[np.floating[Any]]
"""Shape (n, 3), m."""
Values = NDArray[np.floating[Any]]
"""Shape (n,)."""

SEED = 3
"""Seed of the noise behind all textures."""
CELLS = 64
"""Cells along each axis after which the noise repeats; a power of two."""
_BLUR = 0.8
"""Standard deviation of the blur of the lattice, in cells: without, the lattice is seen."""
_STRIDES = np.array([CELLS * CELLS, CELLS, 1], np.int32)


class Noise:
    """Random values on a periodic lattice, with smooth values between."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        white = random.standard_normal((CELLS,) * 3)
        frequency = np.fft.fftfreq(CELLS)
        blur = np.exp(-2.0 * (np.pi * _BLUR * frequency) ** 2)
        spectrum = np.fft.fftn(white) * blur[:, None, None] * blur[:, None] * blur
        smooth = np.fft.ifftn(spectrum).real
        self._seeds = random.uniform(0.25, 0.75, (CELLS**3, 3)).astype(np.float32)
        self._lattice = (smooth / smooth.std()).astype(np.float32).ravel()

    def at(self, points: Points, cell: float, channel: int = 0) -> Values:
        """Return values of mean 0 and standard deviation of about 0.8.

        Args:
            points: where.
            cell: size of a cell of the lattice, m: about half the distance of two bumps.
            channel: channels are independent of one another.
        """
        # float32 suffices: a texel is a thousandth of the period or more
        place = points * np.float32(1.0 / cell) + np.float32(17.0 * channel) * _SHIFT
        low = np.floor(place)
        part = place - low
        part *= part * (np.float32(3.0) - np.float32(2.0) * part)
        index = low.astype(np.int32) & (CELLS - 1)
        nearer, farther = index * _STRIDES, ((index + 1) & (CELLS - 1)) * _STRIDES
        lattice, (fx, fy, fz) = self._lattice, part.T
        layers: list[Values] = []
        for x in (nearer[:, 0], farther[:, 0]):
            rows: list[Values] = []
            for y in (nearer[:, 1], farther[:, 1]):
                first = lattice[x + y + nearer[:, 2]]
                rows.append(first + fz * (lattice[x + y + farther[:, 2]] - first))
            layers.append(rows[0] + fy * (rows[1] - rows[0]))
        return layers[0] + fx * (layers[1] - layers[0])

    def octaves(self, points: Points, cell: float, channel: int = 0, count: int = 3) -> Values:
        """Return a sum of `count` layers, each of half the cells and half the size of the one before."""
        total = np.zeros(len(points), np.float32)
        for octave in range(count):
            total += np.float32(0.5**octave) * self.at(points, cell * 0.5**octave, channel + 31 * octave)
        return total

    def lobules(self, points: Points, cell: float) -> tuple[Values, Values]:
        """Return how far points are inside their lobule, and a number from 0.25 to 0.75 for each lobule.

        Lobules are the Voronoi cells of a point in each cell of the lattice; the first number is 0 between
        two and about 0.7 in the middle of one.
        """
        place = points * np.float32(1.0 / cell)
        corner = np.floor(place - np.float32(0.5)).astype(np.int32)
        nearest = np.full(len(points), np.inf, np.float32)
        second, number = nearest.copy(), np.zeros(len(points), np.float32)
        for step in np.ndindex(2, 2, 2):
            cells = corner + np.array(step, np.int32)
            seeds = self._seeds[(cells & (CELLS - 1)) @ _STRIDES]
            distance = np.linalg.norm(cells + seeds - place, axis=1)
            closer = distance < nearest
            second = np.where(closer, nearest, np.minimum(second, distance))
            number = np.where(closer, seeds[:, 0], number)
            nearest = np.where(closer, distance, nearest)
        return second - nearest, number

    def lines(self, points: Points, cell: float, width: float, channel: int = 0) -> Values:
        """Return 1 on winding lines and 0 beside; `width` is in standard deviations of the noise."""
        return np.exp(-((self.at(points, cell, channel) / np.float32(width)) ** 2))


_SHIFT = np.array([1.0, 0.618, 0.382], np.float32)
"""Distance between two channels, in cells along each axis."""
