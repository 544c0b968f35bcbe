"""A tube with a lumen: a duct, a vessel, or a pouch closed at one end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.meshing.grid import grid_indices, tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from engines.tissue.organs.centre_line import CentreLine, smooth_through
from engines.tissue.organs.inner_wall import InnerWall, wall_along, wall_of_rings
from engines.tissue.organs.picks import Point
from engines.tissue.organs.shape import ROUNDING_DIGITS, Shape
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["TubeParams", "tube_shape"]

_LAYOUTS = [
    (along, around, layers) for layers in (1, 2) for around in range(6, 41, 2) for along in range(4, 201, 2)
]
"""Numbers of cells; an even number around, so that the diagonals meet."""
_NANOMETRE = 1e-9
_STEP = 2e-4
"""Half of the way along the wall over which its slope is taken, m."""
_END = 3e-4
"""Largest distance of the nodes of an end from its plane, m."""
_BED = 0.5
"""Cosine of the half angle of a tube's bed about -z."""
_LOWER = 1.0 / 3.0
"""Share of the line that belongs to the lower bed."""


Wall = Annotated[Length, Field(gt=0, le=0.05)]


class TubeParams(BaseModel):
    """A tube along x around the origin of its frame, or along a path in it. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    length: Length | None = Field(default=None, gt=0, le=1.0, description="of a straight tube")
    path: tuple[Point, ...] | None = Field(
        default=None,
        min_length=2,
        max_length=60,
        description="instead: points of a smooth centre line, from its left end to its right",
    )
    diameter: Length | None = Field(default=None, gt=0, le=0.2, description="outer diameter")
    diameters: tuple[Length, ...] | None = Field(
        default=None, description="instead: outer diameter at each point of the path"
    )
    wall: Wall | tuple[Wall, ...] = Field(
        description="thickness of the wall, or thickness at each point of the path"
    )
    closed: Literal["right"] | None = Field(
        default=None, description="end of a path with a round bottom, as of a pouch"
    )

    @model_validator(mode="after")
    def _has_one_line(self) -> Self:
        if (self.length is None) == (self.path is None):
            raise ValueError("a tube has a length (it is straight) or a path, one of them")
        if (self.diameter is None) == (self.diameters is None):
            raise ValueError("a tube has a diameter, or diameters at the points of its path, one of them")
        is_uneven = self.diameters is not None or isinstance(self.wall, tuple)
        if self.path is None and (is_uneven or self.closed is not None):
            raise ValueError("`diameters`, a `wall` with more than a number, and `closed` go with a `path`")
        for name, values in (("diameters", self.diameters), ("wall", self.wall)):
            if isinstance(values, tuple) and self.path is not None and len(values) != len(self.path):
                raise ValueError(f"{name}: {len(values)} numbers for {len(self.path)} points of the path")
        return self

    @model_validator(mode="after")
    def _has_a_lumen(self) -> Self:
        for diameter, wall in zip(*self._sizes, strict=True):
            if 2.0 * wall >= 0.95 * diameter:
                raise ValueError(
                    f"a wall of {1e3 * wall:g} mm leaves no lumen in a tube of {1e3 * diameter:g} mm"
                )
        return self

    @property
    def _sizes(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Outer diameter and thickness of the wall at each point of the path, m."""
        count = len(self.path or (None,))
        walls = self.wall if isinstance(self.wall, tuple) else (self.wall,) * count
        return self.diameters or (self.diameter or 0.0,) * count, walls

    def cells(self, nodes: int) -> tuple[int, int, int]:
        """Return the numbers of cells along, around and across the wall for about `nodes` nodes."""
        return min(_LAYOUTS, key=lambda cells: self._unfitness(cells, nodes))

    def rings(self, nodes: int) -> Indices:
        """Return the nodes of the inner wall of the mesh, shape (along + 1, around)."""
        along, around, layers = self.cells(nodes)
        rings = along if self.closed else along + 1
        return np.arange(rings * around * (layers + 1)).reshape(rings, around, layers + 1)[:, :, 0]

    def inner_wall(self, mesh: TetMesh, nodes: int) -> InnerWall:
        """Return the inner wall of the tube's mesh for about `nodes` nodes."""
        rings = self.rings(nodes)
        if self.path is None:
            return wall_of_rings(mesh, rings, self.diameter or 0.0)
        along, around, layers = self.cells(nodes)
        at, radii, _ = self.outline.at(along)
        ring = np.arange(len(mesh.nodes)) // (around * (layers + 1))
        return wall_along(mesh, rings, at[ring], 2.0 * radii[: len(rings)])

    def _unfitness(self, cells: tuple[int, int, int], nodes: int) -> float:
        """Return the relative error of the number of nodes, times ten, plus the elongation of the cells."""
        along, around, layers = cells
        miss = abs((along + 1) * around * (layers + 1) / nodes - 1.0)
        length, diameter, wall = self.size
        edges = np.pi * (diameter - wall) / around, length / along, wall / layers
        return 10.0 * miss + max(edges) / min(edges)

    @cached_property
    def size(self) -> tuple[float, float, float]:
        """Length along the wall, and means of outer diameter and of the wall's thickness, m."""
        if self.length is not None:
            return self.length, self.diameter or 0.0, self._sizes[1][0]
        outline = self.outline
        return float(outline.along[-1]), 2.0 * float(outline.radii.mean()), float(outline.walls.mean())

    @cached_property
    def outline(self) -> Outline:
        """Outer outline along the path."""
        assert self.path is not None
        curve = smooth_through(np.column_stack([np.array(self.path), *map(np.array, self._sizes)]))
        outline = Outline(CentreLine(curve[:, :3]), 0.5 * curve[:, 3], curve[:, 4])
        return _closed(outline) if self.closed else outline


@dataclass(frozen=True)
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

    def at(self, cells: int) -> tuple[Vector, Vector, Vector]:
        """Return arc lengths, outer radii and walls of the rings around so many cells, shapes (cells + 1,)."""
        ways = self.even(cells)
        stations, radii, walls = (
            np.interp(ways, self.along, values) for values in (self.line.stations, self.radii, self.walls)
        )
        return stations, radii, walls


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


@lru_cache(maxsize=16)
def _tube_mesh(length: float, diameter: float, wall: float, cells: tuple[int, int, int]) -> TetMesh:
    along, around, layers = cells
    i, j, k = grid_indices(along + 1, around, layers + 1).astype(np.float64).T
    radius = 0.5 * diameter - wall * (1.0 - k / layers)
    angle = 2.0 * np.pi * j / around
    points: Vector = np.stack(
        [length * (i / along - 0.5), -radius * np.sin(angle), -radius * np.cos(angle)], axis=1
    )
    return TetMesh(np.round(points, ROUNDING_DIGITS), tetrahedra_of_cells(cells, closed=True))


@lru_cache(maxsize=64)
def _path_mesh(tube: TubeParams, nodes: int) -> TetMesh:
    """Return the mesh of a tube along a path: rings even along the wall, then the pole of a round bottom."""
    along, around, layers = cells = tube.cells(nodes)
    outline = tube.outline
    line, stations = outline.line, outline.line.stations
    ways = outline.even(along)
    at, radii, walls = outline.at(along)
    before, after = np.maximum(ways - _STEP, 0.0), np.minimum(ways + _STEP, outline.along[-1])
    slope = [
        (np.interp(after, outline.along, values) - np.interp(before, outline.along, values))
        / (after - before)
        for values in (stations, outline.radii)
    ]
    length = np.hypot(*slope)
    slope[0][[0, -1]], slope[1][[0, -1]], length[[0, -1]] = 1.0, 0.0, 1.0  # ends are flat
    if tube.closed:
        slope[0][-1], slope[1][-1] = 0.0, -1.0
    centres = line.at(at)
    tangents, first, second = line.frames(at)
    i, j, k = grid_indices(along + 1, around, layers + 1).T
    inward = walls[i] * (1.0 - k / layers)
    angle = 2.0 * np.pi * j / around
    shift, radius = inward * (slope[1] / length)[i], radii[i] - inward * (slope[0] / length)[i]
    arms = (radius * np.sin(angle))[:, None] * second[i] + (radius * np.cos(angle))[:, None] * first[i]
    points: Vector = np.round(centres[i] + shift[:, None] * tangents[i] + arms, ROUNDING_DIGITS)
    if tube.closed is None:
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


def tube_shape(tube: TubeParams) -> Shape:
    """Return the shape of a tube; its ends are its surfaces `left` and `right`."""
    if tube.path is not None:
        return _path_shape(tube)
    length, diameter, wall = tube.size
    end = 0.5 * length - _NANOMETRE
    return Shape(
        description="a tube of the given size along x of its frame, around the origin",
        mesh=lambda nodes: _tube_mesh(length, diameter, wall, tube.cells(nodes)),
        surfaces={"left": lambda nodes: nodes[:, 0] < -end, "right": lambda nodes: nodes[:, 0] > end},
        anchors=("left", "right"),
        material=None,
    )


def _path_shape(tube: TubeParams) -> Shape:
    """Return the shape of a tube along a path: its ends, and its `bed`, the part that faces -z."""
    outline = tube.outline
    line, whole = outline.line, outline.line.length

    def at_left(nodes: Vector) -> NDArray[np.bool_]:
        return _at_end(nodes, line.points[0], line.points[1], float(outline.radii[0]))

    def at_right(nodes: Vector) -> NDArray[np.bool_]:
        if tube.closed:
            return line.nearest(nodes)[0] > whole - outline.cap
        return _at_end(nodes, line.points[-1], line.points[-2], float(outline.radii[-1]))

    def on_bed(nodes: Vector, first: float = 0.0, last: float = 1.0) -> NDArray[np.bool_]:
        stations, arms = line.nearest(nodes)
        lengths = np.linalg.norm(arms, axis=1)
        middle = np.interp(stations, line.stations, outline.radii - 0.5 * outline.walls)
        is_here = (stations >= first * whole) & (stations <= last * whole)
        return (lengths > middle) & is_here & (-arms[:, 2] > _BED * lengths)

    return Shape(
        description="a tube of the given size along its path",
        mesh=lambda nodes: _path_mesh(tube, nodes),
        surfaces={
            "left": at_left,
            "right": at_right,
            "bed": on_bed,
            "bed-lower": lambda nodes: on_bed(nodes, last=_LOWER),
            "bed-upper": lambda nodes: on_bed(nodes, first=_LOWER),
        },
        anchors=("right",) if tube.closed else ("left", "right"),
        material=None,
    )


def _at_end(nodes: Vector, end: Vector, beside: Vector, radius: float) -> NDArray[np.bool_]:
    """Return whether nodes are those of an end, shape (n,). `beside`: the next point of the line."""
    way = (beside - end) / np.linalg.norm(beside - end)
    off = nodes - end
    return (np.abs((off * way).sum(axis=1)) < _END) & ((off * off).sum(axis=1) < (radius + _END) ** 2)
