"""The outline of a tube along a line, and the mesh of its wall."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from engines.tissue.meshing.grid import grid_indices, tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from engines.tissue.organs.centre_line import CentreLine, smooth_through
from engines.tissue.organs.picks import Point
from engines.tissue.organs.shape import ROUNDING_DIGITS
from schemas.vectors import Vector

__all__ = ["Outline", "outline_along", "path_mesh"]

_STEP = 2e-4
"""Half of the way along the wall over which its slope is taken, m."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Outer radius along a line."""

    line: CentreLine
    radii: Vector
    """Outer radius at each point of the line, m, shape (p,)."""
    walls: Vector
    """Thickness of the wall at each point of the line, m, shape (p,)."""
    cap: float = 0.0
    """Length of a round bottom at the right end, m."""

    @cached_property
    def along(self) -> Vector:
        """Way along the wall to each point of the line, m, shape (p,)."""
        ways = np.hypot(np.diff(self.line.stations), np.diff(self.radii))
        return np.concatenate([[0.0], np.cumsum(ways)])

    def even(self, cells: int) -> Vector:
        """Return ways along the wall, m, of rings around so many cells, shape (cells + 1,)."""
        return self.along[-1] * np.arange(cells + 1) / cells

    def slopes(self, cells: int) -> tuple[Vector, Vector]:
        """Return change of arc length and of radius by way along the wall, at the same rings."""
        ways = self.even(cells)
        before, after = np.maximum(ways - _STEP, 0.0), np.minimum(ways + _STEP, self.along[-1])
        ahead, out = (
            np.interp(after, self.along, values) - np.interp(before, self.along, values)
            for values in (self.line.stations, self.radii)
        )
        length = np.hypot(ahead, out)
        ahead, out = ahead / length, out / length
        ahead[[0, -1]], out[[0, -1]] = 1.0, 0.0  # ends are flat
        if self.cap:
            ahead[-1], out[-1] = 0.0, -1.0
        return ahead, out

    def at(self, cells: int) -> tuple[Vector, Vector, Vector]:
        """Return arc lengths, outer radii and walls of the rings around so many cells."""
        ways = self.even(cells)
        stations, radii, walls = (
            np.interp(ways, self.along, values) for values in (self.line.stations, self.radii, self.walls)
        )
        return stations, radii, walls


@lru_cache(maxsize=64)
def outline_along(
    path: tuple[Point, ...], diameters: tuple[float, ...], walls: tuple[float, ...], *, is_closed: bool
) -> Outline:
    """Return the outline of outer diameters and walls (m) at the points of a path."""
    curve = smooth_through(np.column_stack([np.array(path), np.array(diameters), np.array(walls)]))
    outline = Outline(CentreLine(curve[:, :3]), 0.5 * curve[:, 3], curve[:, 4])
    return _closed(outline) if is_closed else outline


def _closed(outline: Outline) -> Outline:
    """Return an outline with a round bottom at its right end, as long as the last radius."""
    line, cap = outline.line, float(outline.radii[-1])
    angles: Vector = 0.5 * np.pi * (np.arange(41) / 40.0)
    body = line.stations < line.length - cap
    stations = np.concatenate([line.stations[body], line.length - cap + cap * np.sin(angles)])
    radii, walls = (np.interp(stations, line.stations, values) for values in (outline.radii, outline.walls))
    shrink = np.concatenate([np.ones(int(body.sum())), np.cos(angles)])
    shrink[-1] = 0.0
    return Outline(CentreLine(line.at(stations)), radii * shrink, walls, cap)


@lru_cache(maxsize=64)
def path_mesh(outline: Outline, cells: tuple[int, int, int]) -> TetMesh:
    """Return the mesh of a wall: rings even along the wall, and the pole of a round bottom."""
    along, around, layers = cells
    at, radii, walls = outline.at(along)
    ahead, out = outline.slopes(along)
    centres = outline.line.at(at)
    tangents, first, second = outline.line.frames(at)
    i, j, k = grid_indices(along + 1, around, layers + 1).T
    inward = walls[i] * (1.0 - k / layers)
    angle = 2.0 * np.pi * j / around
    shift, radius = inward * out[i], radii[i] - inward * ahead[i]
    arms = (radius * np.sin(angle))[:, None] * second[i] + (radius * np.cos(angle))[:, None] * first[i]
    places: Vector = centres[i] + shift[:, None] * tangents[i] + arms
    points: Vector = np.round(places, ROUNDING_DIGITS)
    if not outline.cap:
        return TetMesh(points, tetrahedra_of_cells(cells, closed=True))
    ring = around * (layers + 1)
    poles = points[along * ring : along * ring + layers + 1]
    body = tetrahedra_of_cells((along - 1, around, layers), closed=True)
    tetrahedra = np.concatenate([body, _bottom(along - 1, around, layers)])
    return TetMesh(np.concatenate([points[: along * ring], poles]), tetrahedra)


def _bottom(last: int, around: int, layers: int) -> Indices:
    """Return the tetrahedra between the ring `last` and the poles, three for each sector and layer.

    Diagonals of the ring's faces join nodes with an odd sum of indices, as in `tetrahedra_of_cells`.
    """
    pole = (last + 1) * around * (layers + 1)
    found: list[list[int]] = []
    for j in range(around):
        for k in range(layers):
            a, b = ((last * around + s % around) * (layers + 1) + k for s in (j, j + 1))
            p = pole + k
            if (last + j + k) % 2:
                found += [[a, p, b, b + 1], [a, p, b + 1, p + 1], [a, a + 1, p + 1, b + 1]]
            else:
                found += [[a, p, b, a + 1], [b, a + 1, p, p + 1], [b, b + 1, a + 1, p + 1]]
    return np.array(found)
