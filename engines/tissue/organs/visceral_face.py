"""The visceral part of a liver about the gallbladder: segments IV and V, with the gallbladder's fossa."""

from __future__ import annotations

from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.anchors import Edges
from engines.tissue.organs.centre_line import smooth_through
from engines.tissue.organs.picks import Point
from engines.tissue.organs.shape import Shape, mesher
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["VisceralFaceParams", "visceral_shape"]

_BLUNTNESS = 2.6
"""Exponent of the outline, a superellipse. By eye."""
_EDGE = 0.35
"""Thickness near the outline over that of the middle. By eye."""
_DOME = 0.10
"""How far the face falls off towards its sides, over the breadth. By eye."""
_CARVED = 0.45
"""Depth of the fossa over the thickness, at most."""
_PORTA = 0.30, 0.62
"""Shares of the length, from the caudal end, between which the face rises from the porta. By eye."""


class VisceralFaceParams(BaseModel):
    """A visceral face towards +z; the origin is in its middle, cranial of the porta. SI units."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    size: Edges = Field(description="breadth along x, length along y, thickness along z")
    porta: Length = Field(
        default=0.02, ge=0, le=0.05, description="how much deeper the caudal part of the face lies"
    )
    fossa: tuple[Point, ...] = Field(
        default=(), max_length=60, description="points of the centre line of what lies in the face"
    )
    diameters: tuple[Length, ...] = Field(default=(), description="width of the fossa at each of its points")

    @model_validator(mode="after")
    def _matching(self) -> Self:
        if len(self.fossa) == 1 or len(self.fossa) != len(self.diameters):
            raise ValueError(
                f"a fossa has two points or more, with a diameter each: not {len(self.fossa)} points and"
                f" {len(self.diameters)} diameters"
            )
        return self

    def field(self, points: Vector) -> Vector:
        """Return the field of a flat body of this size, m, shape (n,)."""
        x, y, z = (2.0 * points / np.array(self.size)).T
        outline = np.abs(x) ** _BLUNTNESS + np.abs(y) ** _BLUNTNESS
        return 0.5 * self.size[2] * (1.0 - np.sqrt(outline ** (2.0 / _BLUNTNESS) * outline + z**2))

    def formed(self, points: Vector) -> Vector:
        """Return points of the flat body, shape (n, 3), where they are in the liver."""
        x, y, z = points.T
        outline = np.abs(2.0 * x / self.size[0]) ** _BLUNTNESS + np.abs(2.0 * y / self.size[1]) ** _BLUNTNESS
        inner = np.clip(1.0 - outline, 0.0, 1.0)
        thinned = z * (_EDGE + (1.0 - _EDGE) * inner)
        height = self._face(x, y)
        above = np.clip(0.5 + z / self.size[2] / np.sqrt(np.maximum(inner, 0.05)), 0.0, 1.0)
        deepest = -_CARVED * self.size[2] * np.sqrt(inner) * (_EDGE + (1.0 - _EDGE) * inner)
        carved = above * np.clip(self._floor(x, y) - height, deepest, 0.0)
        return np.stack([x, y, height - 0.5 * self.size[2] + thinned + carved], axis=1)

    def is_back(self, nodes: Vector) -> NDArray[np.bool_]:
        """Return whether nodes lie on the side away from the face, shape (n,)."""
        x, y, z = nodes.T
        return z < self._face(x, y) - 0.55 * self.size[2]

    def _face(self, x: Vector, y: Vector) -> Vector:
        """Return the height of the face without its fossa, m."""
        share = np.clip((y / self.size[1] + 0.5 - _PORTA[0]) / (_PORTA[1] - _PORTA[0]), 0.0, 1.0)
        rise = share**2 * (3.0 - 2.0 * share)
        return -self.porta * (1.0 - rise) - _DOME * self.size[0] * (2.0 * x / self.size[0]) ** 2

    def _floor(self, x: Vector, y: Vector) -> Vector:
        """Return the height of the fossa's floor, m; infinite beside it."""
        found = np.full(len(x), np.inf)
        for px, py, pz, radius in _fossa_line(self.fossa, self.diameters):
            square = radius * radius - (x - px) ** 2 - (y - py) ** 2
            depth = np.sqrt(np.maximum(square, 0.0))
            found = np.where(square > 0.0, np.minimum(found, pz - depth), found)
        return found


@lru_cache(maxsize=16)
def _fossa_line(points: tuple[Point, ...], diameters: tuple[float, ...]) -> list[list[float]]:
    """Return x, y, z and radius along a fossa, m."""
    if not points:
        return []
    return smooth_through(np.column_stack([np.array(points), 0.5 * np.array(diameters)])).tolist()


def visceral_shape(params: VisceralFaceParams) -> Shape:
    """Return the shape; its surface `face` looks at +z, `back` at -z."""
    return Shape(
        description="the visceral part of a liver about the gallbladder: segments IV and V",
        mesh=lambda nodes: _mesh(params.size, params.porta, params.fossa, params.diameters, nodes),
        surfaces={"back": params.is_back},
        anchors=("back",),
        material="liver",
    )


@lru_cache(maxsize=16)
def _mesh(
    size: tuple[float, float, float],
    porta: float,
    fossa: tuple[Point, ...],
    diameters: tuple[float, ...],
    nodes: int,
) -> TetMesh:
    params = VisceralFaceParams(size=size, porta=porta, fossa=fossa, diameters=diameters)
    x, y, z = (0.5 * edge for edge in size)
    return mesher(params.field, params.formed, low=(-x, -y, -z), high=(x, y, z))(nodes)
