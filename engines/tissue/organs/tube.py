"""A straight tube with a lumen: a duct or a vessel."""

from __future__ import annotations

from functools import lru_cache
from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.meshing.grid import grid_indices, tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from engines.tissue.organs.shape import ROUNDING_DIGITS, Shape
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["TubeParams", "tube_shape"]

_LAYOUTS = [
    (along, around, layers) for layers in (1, 2) for around in range(6, 41, 2) for along in range(4, 201, 2)
]
"""Numbers of cells; an even number around, so that the diagonals meet."""
_NANOMETRE = 1e-9


class TubeParams(BaseModel):
    """A tube along x, around the origin of its frame. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    length: Length = Field(gt=0, le=1.0)
    diameter: Length = Field(gt=0, le=0.2, description="outer diameter")
    wall: Length = Field(gt=0, le=0.05, description="thickness of the wall")

    @model_validator(mode="after")
    def _has_a_lumen(self) -> Self:
        if 2.0 * self.wall >= 0.95 * self.diameter:
            raise ValueError(
                f"a wall of {1e3 * self.wall:g} mm leaves no lumen in a tube of {1e3 * self.diameter:g} mm"
            )
        return self

    def cells(self, nodes: int) -> tuple[int, int, int]:
        """Return the numbers of cells along, around and across the wall for about `nodes` nodes."""
        return min(_LAYOUTS, key=lambda cells: self._unfitness(cells, nodes))

    def rings(self, nodes: int) -> Indices:
        """Return the nodes of the inner wall of the mesh, shape (along + 1, around)."""
        along, around, layers = self.cells(nodes)
        return np.arange((along + 1) * around * (layers + 1)).reshape(along + 1, around, layers + 1)[:, :, 0]

    def _unfitness(self, cells: tuple[int, int, int], nodes: int) -> float:
        """Return the relative error of the number of nodes, times ten, plus the elongation of the cells."""
        along, around, layers = cells
        miss = abs((along + 1) * around * (layers + 1) / nodes - 1.0)
        edges = np.pi * (self.diameter - self.wall) / around, self.length / along, self.wall / layers
        return 10.0 * miss + max(edges) / min(edges)


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
    end = 0.5 * tube.length - _NANOMETRE
    return Shape(
        description="a tube of the given size along x of its frame, around the origin",
        mesh=lambda nodes: _tube_mesh(tube.length, tube.diameter, tube.wall, tube.cells(nodes)),
        surfaces={"left": lambda nodes: nodes[:, 0] < -end, "right": lambda nodes: nodes[:, 0] > end},
        anchors=("left", "right"),
        material=None,
    )
