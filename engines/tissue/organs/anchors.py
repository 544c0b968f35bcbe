"""Anchors of an organ: surfaces tied to the world, or to rigid parts of the scene."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from robots.dvrk.parameters import UnitQuaternion
from schemas.quantity import Length
from schemas.scenario import Name
from schemas.vectors import Vector

__all__ = ["WORLD", "AnchorParams", "Edges", "RigidParams"]

WORLD = "world"

Edge = Annotated[Length, Field(gt=0)]
Edges = tuple[Edge, Edge, Edge]
_Point = tuple[Length, Length, Length]


class Box(BaseModel):
    """A box in the organ's own frame."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    low: _Point = Field(description="its corner with the smallest x, y, z")
    high: _Point = Field(description="its corner with the largest x, y, z")

    def depth(self, nodes: Vector) -> Vector:
        """Return how far inside the box nodes (m), shape (n, 3), lie, m, shape (n,)."""
        return np.minimum(nodes - np.array(self.low), np.array(self.high) - nodes).min(axis=1)


class AnchorParams(BaseModel):
    """An anchored part of an organ's surface, and its support."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    surface: str | None = Field(
        default=None,
        description="`trocar organs` lists them; every organ has left, right, front, back, bottom, top",
    )
    box: Box | None = Field(
        default=None, description="instead: the part of the surface inside a box in the organ's own frame"
    )
    to: Name = Field(default=WORLD, description="`world`, or the name of a rigid part")

    @model_validator(mode="after")
    def _one_part(self) -> Self:
        if (self.surface is None) == (self.box is None):
            raise ValueError("an anchor names a surface or a box, one of them")
        return self


class RigidParams(BaseModel):
    """A fixed rigid box: a bed under organs, or a wall as support of anchors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    box: Edges = Field(description="edge lengths along x, y, z of its own frame")
    position: _Point = Field(default=(0.0, 0.0, 0.0), description="of its middle in `world`")
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0), description="of its frame in `world`: quaternion x, y, z, w"
    )
    friction: float = Field(default=0.5, ge=0, le=2, description="Coulomb coefficient against tissue")
