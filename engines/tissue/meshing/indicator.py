"""The inside of a surface with holes, overlaps and slivers, as a smooth field.

The gradient of the indicator function of a body is its surface's normals, so the indicator is the solution of
Poisson's equation with their divergence, here by Fourier transforms (Kazhdan, Reconstruction of Solid Models
from Oriented Point Sets, Symposium on Geometry Processing 2005). Holes are closed by the smoothest membrane;
how triangles are joined does not matter.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.surface import Surface
from schemas.vectors import Vector

__all__ = ["Indicator"]

_PADDING = 8
"""Cells around the surface: the transform repeats the body in all directions."""
_BLUR = 0.8
"""Standard deviation of the smoothing, in cells: without it the indicator rings at the surface."""
_LEVEL = 0.5


class Indicator:
    """The field of a body: positive inside, about the depth near the surface.

    Values of a regular grid, and linear between them.
    """

    def __init__(self, samples: Surface, step: float) -> None:
        """Sample the body.

        Args:
            samples: surface in triangles smaller than a cell, normals outwards, m.
            step: edge of a cell, m.
        """
        self.step = step
        low, high = samples.vertices.min(axis=0), samples.vertices.max(axis=0)
        shape = np.ceil((high - low) / step).astype(np.int64) + 2 * _PADDING
        self._low = 0.5 * (low + high) - 0.5 * step * (shape - 1)
        indicator = _solve_poisson(self._splat(samples, shape), step)
        edge = np.concatenate([indicator[0].ravel(), indicator[-1].ravel()])
        slope = 1.0 / (np.sqrt(2.0 * np.pi) * _BLUR * step)  # of a blurred step at the surface, 1/m
        self.values: NDArray[np.float64] = (indicator - edge.mean() - _LEVEL) / slope
        """Values at the corners of the cells, shape (i, j, k), m."""

    def _splat(self, samples: Surface, shape: NDArray[np.int64]) -> Vector:
        """Return the area vectors spread to the corners of their cells, shape (i, j, k, 3), m^2."""
        cell, share = self._cells(samples.middles, shape)
        vectors, size = samples.area_vectors, int(np.prod(shape))
        field = np.zeros((size, 3))
        for corner in product((0, 1), repeat=3):
            place = np.ravel_multi_index(tuple((cell + corner).T), tuple(shape.tolist()))
            weight = np.where(corner, share, 1.0 - share).prod(axis=1)
            for axis in range(3):
                field[:, axis] += np.bincount(place, weight * vectors[:, axis], size)
        return field.reshape(*shape.tolist(), 3)

    def _cells(self, points: Vector, shape: NDArray[np.int64]) -> tuple[NDArray[np.int64], Vector]:
        """Return the cell of each point, shape (n, 3), and the place within it, 0 to 1, shape (n, 3)."""
        place = np.clip((points - self._low) / self.step, 0.0, shape - 1.001)
        cell = place.astype(np.int64)
        return cell, place - cell

    def __call__(self, points: Vector) -> Vector:
        """Return the field at points, shape (n, 3), m: shape (n,), m."""
        cell, share = self._cells(points, np.array(self.values.shape))
        total = np.zeros(len(points))
        for corner in product((0, 1), repeat=3):
            weight = np.where(corner, share, 1.0 - share).prod(axis=1)
            total += weight * self.values[tuple((cell + corner).T)]
        return total

    def keep(self, inside: NDArray[np.bool_]) -> None:
        """Leave other parts of the body out; `inside`: grid points of the part to keep, shape (i, j, k)."""
        self.values = np.where(~inside & (self.values > 0.0), -self.step, self.values)

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """The corners of a box around the body, m, shapes (3,)."""
        inside = np.argwhere(self.values > 0.0)
        low, high = self._low + self.step * inside.min(axis=0), self._low + self.step * inside.max(axis=0)
        return low - self.step, high + self.step

    @property
    def volume(self) -> float:
        """Volume of the body, m^3: a cell at the surface counts by its depth."""
        share = np.clip(self.values / self.step + 0.5, 0.0, 1.0)
        return float(share.sum() * self.step**3)


def _solve_poisson(areas: Vector, step: float) -> NDArray[np.float64]:
    """Return the blurred indicator, shape (i, j, k), up to a constant, of `areas`, shape (i, j, k, 3)."""
    shape = areas.shape[:3]
    waves = [2.0 * np.pi * np.fft.fftfreq(n, step) for n in shape[:2]]
    waves.append(2.0 * np.pi * np.fft.rfftfreq(shape[2], step))
    grids = np.meshgrid(*waves, indexing="ij")
    square = np.sum([wave**2 for wave in grids], axis=0)
    square[0, 0, 0] = np.inf
    divergence = sum(1j * wave * np.fft.rfftn(areas[..., axis] / step**3) for axis, wave in enumerate(grids))
    blur = np.exp(-0.5 * np.where(np.isinf(square), 0.0, square) * (_BLUR * step) ** 2)
    return np.fft.irfftn(divergence * blur / square, shape, axes=(0, 1, 2))
