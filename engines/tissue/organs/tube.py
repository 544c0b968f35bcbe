"""A tube with a lumen: a duct, a vessel, or a pouch closed at one end."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.meshing.grid import grid_indices, tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from engines.tissue.organs.inner_wall import InnerWall, wall_along, wall_of_rings
from engines.tissue.organs.outline import Outline, outline_along, path_mesh
from engines.tissue.organs.picks import Point
from engines.tissue.organs.shape import ROUNDING_DIGITS, Shape
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["TubeParams", "Wall", "tube_shape"]

_LAYOUTS = np.array(
    [(along, around, layers) for layers in (1, 2) for around in range(6, 41, 2) for along in range(4, 201, 2)]
)
"""Numbers of cells along, around and across the wall, shape (n, 3); an even number around, so that the
diagonals meet.
"""
_NANOMETRE = 1e-9
_END = 3e-4
"""Largest distance of the nodes of an end from its plane, m."""
_BED = 0.5
"""Cosine of the half angle of a tube's bed about -z."""


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
        along, around, layers = _LAYOUTS[self._unfitness(nodes).argmin()].tolist()
        return along, around, layers

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

    def _unfitness(self, nodes: int) -> Vector:
        """Return ten relative errors of the number of nodes plus the elongation of the cells, by layout."""
        along, around, layers = _LAYOUTS.T
        miss = np.abs((along + 1) * around * (layers + 1) / nodes - 1.0)
        length, diameter, wall = self.size
        edges = np.stack([np.pi * (diameter - wall) / around, length / along, wall / layers])
        return 10.0 * miss + edges.max(axis=0) / edges.min(axis=0)

    @cached_property
    def size(self) -> tuple[float, float, float]:
        """Length along the wall, and means of outer diameter and of the wall's thickness, m."""
        if self.length is not None:
            return self.length, self.diameter or 0.0, self._sizes[1][0]
        outline = self.outline
        return float(outline.along[-1]), 2.0 * float(outline.radii.mean()), float(outline.walls.mean())

    @property
    def outline(self) -> Outline:
        """Outer outline along the path."""
        assert self.path is not None
        return outline_along(self.path, *self._sizes, is_closed=self.closed is not None)


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

    def on_bed(nodes: Vector) -> NDArray[np.bool_]:
        stations, arms = line.nearest(nodes)
        lengths = np.linalg.norm(arms, axis=1)
        middle = np.interp(stations, line.stations, outline.radii - 0.5 * outline.walls)
        return (lengths > middle) & (-arms[:, 2] > _BED * lengths)

    return Shape(
        description="a tube of the given size along its path",
        mesh=lambda nodes: path_mesh(outline, tube.cells(nodes)),
        surfaces={
            "left": at_left,
            "right": at_right,
            "bed": on_bed,
        },
        anchors=("right",) if tube.closed else ("left", "right"),
        material=None,
    )


def _at_end(nodes: Vector, end: Vector, beside: Vector, radius: float) -> NDArray[np.bool_]:
    """Return whether nodes are those of an end, shape (n,). `beside`: the next point of the line."""
    way = (beside - end) / np.linalg.norm(beside - end)
    off = nodes - end
    return (np.abs((off * way).sum(axis=1)) < _END) & ((off * off).sum(axis=1) < (radius + _END) ** 2)
