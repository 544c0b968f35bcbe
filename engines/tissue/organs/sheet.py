"""A sheet that is draped over what lies below: peritoneum with its fat."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.centre_line import smooth_through
from engines.tissue.organs.shape import ROUNDING_DIGITS, Shape
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["SheetParams", "sheet_shape"]

_RIM = 0.5
"""Thickness at the rim over that of the middle. By eye."""
_ROUNDED = 0.3
"""How round the outline is: 0 a rectangle, 0.5 an ellipse. By eye."""
_LOWER = 0.3
"""Share of the thickness that belongs to the underside."""

Edge = Annotated[Length, Field(gt=0, le=0.5)]


class SheetParams(BaseModel):
    """A sheet over the origin of its frame. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    size: tuple[Edge, Edge] = Field(description="breadth along x, length along y")
    thickness: Edge = Field(description="in the middle; the rim is thinner")
    heights: tuple[tuple[Length, ...], ...] = Field(
        min_length=2,
        max_length=30,
        description="heights of the underside on an even grid: rows from -y to +y, each from -x to +x",
    )

    @model_validator(mode="after")
    def _is_a_grid(self) -> Self:
        if len({len(row) for row in self.heights}) != 1 or len(self.heights[0]) < 2:
            raise ValueError("heights are rows of the same number of heights, two or more")
        return self


def sheet_shape(params: SheetParams) -> Shape:
    """Return the shape of a sheet; its `underside` lies on what is below."""

    def is_underside(nodes: Vector) -> NDArray[np.bool_]:
        thickness = params.thickness * _thinned(nodes, params.size)
        floor = _heights_at(nodes, params.size, params.heights)
        return nodes[:, 2] < floor + _LOWER * thickness

    return Shape(
        description="a sheet that is draped over what lies below",
        mesh=lambda nodes: _mesh(params.size, params.thickness, params.heights, nodes),
        surfaces={"underside": is_underside},
        anchors=(),
        material="fat",
    )


@lru_cache(maxsize=16)
def _mesh(
    size: tuple[float, float], thickness: float, heights: tuple[tuple[float, ...], ...], nodes: int
) -> TetMesh:
    flat = block(np.array([*size, thickness]), nodes)
    places = flat.nodes.copy()
    x, y = (2.0 * places[:, :2] / np.array(size)).T
    places[:, 0] *= np.sqrt(1.0 - _ROUNDED * y * y)
    places[:, 1] *= np.sqrt(1.0 - _ROUNDED * x * x)
    above = (places[:, 2] + thickness) * _thinned(places, size)
    places[:, 2] = _heights_at(places, size, heights) + above
    return TetMesh(np.round(places, ROUNDING_DIGITS), flat.tetrahedra)


def _thinned(points: Vector, size: tuple[float, float]) -> Vector:
    """Return the thickness at points over that of the middle, shape (n,)."""
    x, y = (2.0 * points[:, :2] / np.array(size)).T
    return 1.0 - (1.0 - _RIM) * np.maximum(x**4, y**4)


def _heights_at(points: Vector, size: tuple[float, float], heights: tuple[tuple[float, ...], ...]) -> Vector:
    """Return the height of the underside at points, m, shape (n,)."""
    fine = smooth_through(smooth_through(np.array(heights)).T)  # (x, y)
    shares = np.clip(points[:, :2] / np.array(size) + 0.5, 0.0, 1.0) * (np.array(fine.shape) - 1)
    low = np.minimum(shares.astype(np.int64), np.array(fine.shape) - 2)
    u, v = (shares - low).T
    i, j = low.T
    near, far = (fine[k, j] * (1.0 - v) + fine[k, j + 1] * v for k in (i, i + 1))
    return near * (1.0 - u) + far * u
