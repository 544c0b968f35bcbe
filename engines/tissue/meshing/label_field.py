"""The inside of an organ's voxels as a smooth field that does not shrink.

The distance to the voxels' boundary, smoothed by 2 G - G G, G a Gaussian: wide waves pass unchanged, as with
two steps of opposite sign (Taubin, A Signal Processing Approach to Fair Surface Design, SIGGRAPH 1995), here
of the field and so without a mesh. The level keeps the volume of the voxels.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["LabelField"]

_PADDING = 4.0
"""Free space around the organ, in edges of a cube of a voxel's volume."""
_BLUR = 1.0
"""Standard deviation of the Gaussian, in voxels: steps of voxels are gone, and the surface of a tube of two
voxels' radius keeps its place within 0.2 of one.
"""
_LONGEST = 2.0
"""Edge of a voxel over the shortest edge; longer ones are divided."""
_BISECTIONS = 30


class LabelField:
    """The field of a body: positive inside, about the depth near the surface, m."""

    def __init__(self, inside: NDArray[np.bool_], affine: Vector) -> None:
        """Smooth the voxels.

        Args:
            inside: voxels of the body, shape (i, j, k).
            affine: map of voxel numbers to metres, shape (3, 4).
        """
        ndimage: Any = import_module("scipy.ndimage")
        self._spline: Any = ndimage.map_coordinates
        spacing: Vector = np.linalg.norm(affine[:, :3], axis=0).astype(np.float64)
        self.spacing = float(np.prod(spacing) ** (1.0 / 3.0))
        """Edge of a cube of a voxel's volume, m."""
        padding = np.maximum(2, np.ceil(_PADDING * self.spacing / spacing)).astype(np.int64)
        padded = np.pad(inside, np.stack([padding, padding], axis=1))
        low = affine[:, 3] - affine[:, :3] @ padding
        distance = ndimage.distance_transform_edt(padded, sampling=spacing)
        distance = distance - ndimage.distance_transform_edt(~padded, sampling=spacing)
        once = ndimage.gaussian_filter(distance, _BLUR)
        values = 2.0 * once - ndimage.gaussian_filter(once, _BLUR)
        split = np.maximum(1, np.rint(spacing / (_LONGEST * spacing.min()))).astype(np.int64)
        self._values: NDArray[np.float64] = ndimage.zoom(
            values, split, order=1, grid_mode=True, mode="nearest"
        )
        self._axes: Vector = affine[:, :3] / split
        self._low: Vector = low + self._axes @ (0.5 * (1.0 - split))
        self._inverse: Vector = np.linalg.inv(self._axes).astype(np.float64)
        self.raw_volume = float(inside.sum() * np.prod(spacing))
        """Volume of the voxels, m^3."""
        self._values -= self._level()

    def __call__(self, points: Vector) -> Vector:
        """Return the field at points, shape (n, 3), m: shape (n,), m."""
        places = (points - self._low) @ self._inverse.T
        found: Vector = self._spline(self._values, places.T, order=1, mode="nearest")
        return found

    @property
    def volume(self) -> float:
        """Volume of the body, m^3: a cell at the surface counts by its depth."""
        return self._volume(self._values)

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """The corners of a box around the body, m, shapes (3,)."""
        places = self._low + np.argwhere(self._values > 0.0) @ self._axes.T
        cell = np.abs(self._axes).sum(axis=1)
        return places.min(axis=0) - cell, places.max(axis=0) + cell

    def _volume(self, values: NDArray[np.float64]) -> float:
        edges: Vector = np.linalg.norm(self._axes, axis=0).astype(np.float64)
        share = np.clip(values / float(edges.mean()) + 0.5, 0.0, 1.0)
        return float(share.sum() * np.prod(edges))

    def _level(self) -> float:
        """Return the value of the surface that encloses the volume of the voxels."""
        low, high = -self.spacing, self.spacing
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if self._volume(self._values - middle) > self.raw_volume:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)
