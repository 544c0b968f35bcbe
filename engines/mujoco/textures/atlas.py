"""Unfolds the resting surface of a body into one square picture without seams in the colours.

Neighbouring triangles that face the same side of a box form a chart: their projection onto that side. Every
texel knows its place in space, and noise in space has the same value on both sides of a seam.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.textures.noise import Noise, Points, Values
from engines.mujoco.textures.surface import Maps, Recipe, Surface, make_maps
from schemas.vectors import Vector

__all__ = ["SIDES", "Atlas", "Indices", "facing_side", "picture_side"]

Indices = NDArray[np.int64]

_X, _Y, _Z = np.eye(3)
SIDES: NDArray[np.float64] = np.array(
    [[_Y, _Z, _X], [_Z, _Y, -_X], [_Z, _X, _Y], [_X, _Z, -_Y], [_X, _Y, _Z], [_Y, _X, -_Z]]
)
"""Axes u, v and outward normal of the sides of a box, shape (6, 3, 3), each right-handed."""
_PIXELS, _LEAST_PIXELS = 1024, 128
"""Largest and least side of the picture of an outside: 0.1 to 0.4 mm a texel on an organ with the largest."""
_TEXELS = 32 * _PIXELS**2
"""Most texels of all outsides of a scene: with three maps and their smaller ones about 0.5 GB."""
_MARGIN = 5
"""Texels around a chart, filled with the colours of its edge: smaller pictures of the texture mix them."""
_FULL, _SHRINK = 0.8, 0.94
"""Share of the picture covered by charts to begin with, and the factor for the next try."""
_SMOOTHING = 3
"""Passes in which a triangle joins its neighbours' side."""


def facing_side(normals: Vector) -> Indices:
    """Return the side of the box that each of `normals`, shape (f, 3), faces most."""
    return np.argmax(normals @ SIDES[:, 2].T, axis=1)


def picture_side(bodies: int) -> int:
    """Return the side of the pictures of outsides, texels, for the number of bodies in a scene."""
    side = _PIXELS
    while bodies * side**2 > _TEXELS and side > _LEAST_PIXELS:
        side //= 2
    return side


class Atlas:
    """Charts of a surface."""

    def __init__(self, rest: Vector, triangles: Indices, pixels: int) -> None:
        """Unfold triangles, node indices of shape (f, 3), of `rest`, shape (n, 3), m, into `pixels`^2."""
        self._rest, self._triangles, self._pixels = rest, triangles, pixels
        corners = rest[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        neighbours = _neighbours(triangles)
        side = _smoothed(facing_side(normals), normals, neighbours)
        self.chart: Indices = _connected(side, neighbours)
        """Chart of each triangle, shape (f,)."""
        first = np.unique(self.chart, return_index=True)[1]
        self.axes: NDArray[np.float64] = SIDES[side[first]]
        """Axes u, v and normal of each chart, shape (c, 3, 3)."""
        flat = np.einsum("fkj,fij->fki", corners, self.axes[self.chart][:, :2])  # (f, 3, 2), m
        low = np.full((len(first), 2), np.inf)
        high = -low
        np.minimum.at(low, self.chart, flat.min(axis=1))
        np.maximum.at(high, self.chart, flat.max(axis=1))
        self.texel, places = _pack(high - low, pixels)
        """Size of a texel, m."""
        self._offset = places - low / self.texel  # (c, 2), texels

    def uv(self, points: Vector, chart: Indices) -> NDArray[np.float32]:
        """Return texture coordinates, shape (n, 2), of points at rest, shape (n, 3), m, in their charts."""
        flat = np.einsum("nj,nij->ni", points, self.axes[chart][:, :2])
        return ((flat / self.texel + self._offset[chart]) / self._pixels).astype(np.float32)

    def paint(self, recipe: Recipe, noise: Noise) -> Maps:
        """Return the maps of the whole surface."""
        texels = self._texels()
        found = recipe(noise, self._places(texels))
        return make_maps(
            Surface(*(values[texels.nearest] for values in found)), (self._pixels, self._pixels), self.texel
        )

    def at_texels(self, values: Callable[[Points], Values]) -> Values:
        """Return values at the places of all texels, shape (pixels^2,)."""
        texels = self._texels()
        return values(self._places(texels))[texels.nearest]

    def interpolate(self, values: Vector) -> Values:
        """Return values at all texels, shape (pixels^2,), for values at the nodes, shape (n,)."""
        texels = self._lookup
        corners = values.astype(np.float32)[self._triangles]
        return np.einsum("kj,kj->k", texels.weights, corners[texels.triangle])[texels.nearest]

    @cached_property
    def _lookup(self) -> _Texels:
        return self._texels()

    def _places(self, texels: _Texels) -> Points:
        corners = self._rest.astype(np.float32)[self._triangles]
        return np.einsum("kj,kji->ki", texels.weights, corners[texels.triangle])

    def _texels(self) -> _Texels:
        corners = self._rest[self._triangles]
        flat = self.uv(corners.reshape(-1, 3), self.chart.repeat(3)).astype(np.float64) * self._pixels
        numbers: list[Indices] = []
        weights: list[NDArray[np.float32]] = []
        for triangle in flat.reshape(-1, 3, 2) - 0.5:
            row, column, weight = _filled(triangle)
            numbers.append(row * self._pixels + column)
            weights.append(weight.astype(np.float32))
        return _Texels(
            np.repeat(np.arange(len(corners), dtype=np.int32), [len(one) for one in numbers]),
            np.concatenate(weights),
            _spread(np.concatenate(numbers), self._pixels**2, self._pixels),
        )


class _Texels(NamedTuple):
    """The texels inside triangles."""

    triangle: NDArray[np.int32]
    """Triangle of each, shape (k,)."""
    weights: NDArray[np.float32]
    """Weights of its corners, shape (k, 3)."""
    nearest: NDArray[np.int32]
    """For every texel of the picture the nearest of these, shape (pixels^2,)."""


def _filled(triangle: Vector) -> tuple[Indices, Indices, Vector]:
    """Return rows, columns and weights, shape (k, 3), of the texels of a triangle, shape (3, 2), texels."""
    low, high = np.floor(triangle.min(axis=0)), np.ceil(triangle.max(axis=0))
    first, (one, two) = triangle[0], triangle[1:] - triangle[0]
    area = one[0] * two[1] - one[1] * two[0]
    x = np.arange(int(low[0]), int(high[0]) + 1)[None, :] - first[0]
    y = np.arange(int(low[1]), int(high[1]) + 1)[:, None] - first[1]
    size = area if area > 0.0 else np.inf
    second, third = (x * two[1] - y * two[0]) / size, (one[0] * y - one[1] * x) / size
    inside = (second > -_EDGE) & (third > -_EDGE) & (second + third < 1.0 + _EDGE) & (area > 0.0)
    row, column = np.nonzero(inside)
    weights = np.stack([1.0 - second - third, second, third], axis=-1)[row, column]
    return row + int(low[1]), column + int(low[0]), weights


_EDGE = 0.02
"""Share of a triangle by which texels beyond its edge belong to it."""


def _neighbours(triangles: Indices) -> Indices:
    """Return pairs of triangles with a common edge, shape (e, 2)."""
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, edge, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    edge = edge.ravel()
    order = np.argsort(edge, kind="stable")
    return order[(count == 2)[edge[order]]].reshape(-1, 2) // 3


def _smoothed(side: Indices, normals: Vector, neighbours: Indices) -> Indices:
    """Return sides without single triangles between others, as far as these can be seen from there."""
    faces = np.arange(len(side))
    seen = normals @ SIDES[:, 2].T > 0.35 * np.linalg.norm(normals, axis=1, keepdims=True)
    for _ in range(_SMOOTHING):
        votes = np.zeros((len(side), len(SIDES)))
        votes[faces, side] = 1.5
        np.add.at(votes, (neighbours[:, 0], side[neighbours[:, 1]]), 1.0)
        np.add.at(votes, (neighbours[:, 1], side[neighbours[:, 0]]), 1.0)
        side = np.argmax(np.where(seen, votes, votes - 10.0), axis=1)
    return side


def _connected(side: Indices, neighbours: Indices) -> Indices:
    """Return a number from 0 for each triangle, equal for connected triangles of one side."""
    one, other = neighbours[side[neighbours[:, 0]] == side[neighbours[:, 1]]].T
    label = np.arange(len(side))
    while True:
        before = label.copy()
        lowest = np.minimum(label[one], label[other])
        np.minimum.at(label, one, lowest)
        np.minimum.at(label, other, lowest)
        label = label[label]
        if np.array_equal(label, before):
            return np.unique(label, return_inverse=True)[1]


def _pack(extents: Vector, pixels: int) -> tuple[float, NDArray[np.float64]]:
    """Return the size of a texel, m, and the corners of rectangles in the picture, shape (c, 2), texels.

    The rectangles stand on shelves, the highest first.
    """
    order = np.argsort(-extents[:, 1], kind="stable")
    texel = sqrt(float(extents.prod(axis=1).sum()) / _FULL) / pixels
    while True:
        sizes = np.ceil(extents / texel) + 2 * _MARGIN
        places = np.zeros_like(extents)
        x = y = shelf = 0.0
        for chart in order:
            width, height = sizes[chart]
            if x + width > pixels:
                x, y, shelf = 0.0, y + shelf, 0.0
            places[chart] = x, y
            x, shelf = x + width, max(shelf, height)
        if y + shelf <= pixels and sizes[:, 0].max() <= pixels:
            return texel, places + _MARGIN
        texel /= _SHRINK


def _spread(index: Indices, count: int, width: int) -> NDArray[np.int32]:
    """Return for each of `count` texels the nearest texel of `index` as a place in it; far from all: 0."""
    nearest = np.full(count, -1, np.int32)
    nearest[index] = np.arange(len(index), dtype=np.int32)
    for _ in range(ceil(_MARGIN)):
        for step in (1, -1, width, -width):
            moved = np.roll(nearest, step)
            nearest = np.where(nearest < 0, moved, nearest)
    return np.maximum(nearest, 0)
