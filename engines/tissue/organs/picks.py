"""Parts of an organ's surface, picked by normals, boxes and planes."""

from __future__ import annotations

from math import pi, radians
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    model_validator,
)

from engines.tissue.meshing.tet_mesh import TetMesh
from schemas.quantity import Angle, Length
from schemas.vectors import Vector

__all__ = ["Box", "NodePick", "Plane", "Point", "SurfacePick"]

_WITHIN = radians(30.0)
Point = tuple[Length, Length, Length]

_AXES = {
    sign + name: tuple((-1.0 if sign == "-" else 1.0) if i == axis else 0.0 for i in range(3))
    for axis, name in enumerate("xyz")
    for sign in ("+", "-")
}


def _parse_direction(value: Any) -> Any:
    """Return the vector of an axis by its name, such as `-z`; other values are returned unchanged."""
    if isinstance(value, str):
        if value not in _AXES:
            raise ValueError(f"'{value}' is no direction: one of {', '.join(_AXES)}, or three numbers")
        return _AXES[value]
    return value


def _normalise(value: tuple[float, float, float]) -> tuple[float, float, float]:
    length = float(np.linalg.norm(value))
    if not 1e-9 < length < 1e9:
        raise ValueError("a direction has three numbers, not all of them 0")
    x, y, z = value
    return x / length, y / length, z / length


_NUMBER = {"type": "number"}
Direction = Annotated[
    tuple[float, float, float],
    BeforeValidator(_parse_direction),
    AfterValidator(_normalise),
    Field(description="an axis, such as -z, or a vector of any length"),
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": list(_AXES)},
                {"type": "array", "prefixItems": [_NUMBER] * 3, "minItems": 3, "maxItems": 3},
            ]
        }
    ),
]


class Box(BaseModel):
    """A box in the organ's own frame."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    low: Point = Field(description="its corner with the smallest x, y, z")
    high: Point = Field(description="its corner with the largest x, y, z")

    def depth(self, nodes: Vector) -> Vector:
        """Return how far inside the box nodes (m), shape (n, 3), lie, m, shape (n,)."""
        return np.minimum(nodes - np.array(self.low), np.array(self.high) - nodes).min(axis=1)


class Plane(BaseModel):
    """The half of space on one side of a plane, in the organ's own frame."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    point: Point = Field(description="of the plane")
    towards: Direction = Field(description="normal of the plane: the side that is picked")

    def height(self, nodes: Vector) -> Vector:
        """Return how far beyond the plane nodes (m), shape (n, 3), lie, m, shape (n,)."""
        return (nodes - np.array(self.point)) @ np.array(self.towards)


class SurfacePick(BaseModel):
    """A part of a surface: the nodes that meet all stated conditions."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    box: Box | None = Field(default=None, description="nodes inside a box in the organ's own frame")
    normal: Direction | None = Field(
        default=None, description="nodes of faces whose outward normal has this direction"
    )
    within: Angle = Field(default=_WITHIN, gt=0, le=pi, description="largest angle of a face to `normal`")
    plane: Plane | None = Field(default=None, description="nodes beyond a plane")

    @property
    def is_empty(self) -> bool:
        """Whether no condition is stated."""
        return self.box is None and self.normal is None and self.plane is None

    @model_validator(mode="after")
    def _check_angle(self) -> Self:
        if self.normal is None and self.within != _WITHIN:
            raise ValueError("`within` is the angle to a normal: state `normal`")
        return self

    def nodes(self, mesh: TetMesh) -> NDArray[np.bool_]:
        """Return the picked nodes of the surface of `mesh`, shape (n,)."""
        triangles = mesh.triangles
        if self.normal is not None:
            triangles = triangles[_angles(mesh.nodes[triangles], self.normal) <= self.within + 1e-6]
        picked = np.zeros(len(mesh.nodes), np.bool_)
        picked[triangles] = True
        if self.box is not None:
            picked &= self.box.depth(mesh.nodes) >= 0.0
        if self.plane is not None:
            picked &= self.plane.height(mesh.nodes) >= 0.0
        return picked


class NodePick(BaseModel):
    """A part of a surface by the numbers of its nodes: where two organs of one scan touch."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    numbers: tuple[Annotated[int, Field(ge=0)], ...] = Field(min_length=1, max_length=5000)

    def nodes(self, mesh: TetMesh) -> NDArray[np.bool_]:
        """Return the picked nodes of `mesh`, shape (n,). Raises ValueError for a node that is not there."""
        picked = np.zeros(len(mesh.nodes), np.bool_)
        if max(self.numbers) >= len(picked):
            raise ValueError(f"a surface names node {max(self.numbers)}, and the mesh has {len(picked)}")
        picked[list(self.numbers)] = True
        return picked


def _angles(corners: Vector, direction: tuple[float, float, float]) -> Vector:
    """Return the angle (rad) of each face's normal to a direction, shape (f,).

    `corners`: of the faces, shape (f, 3, 3), m.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.arccos(np.clip(normals @ np.array(direction), -1.0, 1.0))
