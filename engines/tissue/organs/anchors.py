"""Anchors of an organ: surfaces tied to the world, to rigid parts of the scene, or to a moving probe."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.organs.picks import Point, SurfacePick
from robots.dvrk.parameters import UnitQuaternion
from schemas.quantity import Length
from schemas.scenario import Name

__all__ = ["WORLD", "AnchorParams", "Edges", "RigidParams"]

WORLD = "world"

Edge = Annotated[Length, Field(gt=0)]
Edges = tuple[Edge, Edge, Edge]


class AnchorParams(SurfacePick):
    """An anchored part of an organ's surface, by name or picked, and its support."""

    surface: str | None = Field(
        default=None,
        description="`trocar organs` lists them; every organ has left, right, front, back, bottom, top",
    )
    to: Name = Field(
        default=WORLD,
        description=(
            "`world`, the name of a rigid part, or with kind fem of a probe with `spheres: 1`, which carries"
            " the surface along as it moves"
        ),
    )

    @model_validator(mode="after")
    def _one_part(self) -> Self:
        if (self.surface is None) == self.is_empty:
            raise ValueError(
                "an anchor names a surface, or picks nodes by a box, a normal or a plane: one of both"
            )
        return self


class RigidParams(BaseModel):
    """A fixed rigid box: a bed under organs, or a wall as support of anchors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    box: Edges = Field(description="edge lengths along x, y, z of its own frame")
    position: Point = Field(default=(0.0, 0.0, 0.0), description="of its middle in `world`")
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0), description="of its frame in `world`: quaternion x, y, z, w"
    )
    friction: float = Field(default=0.5, ge=0, le=2, description="Coulomb coefficient against tissue")
