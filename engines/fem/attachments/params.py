"""Parameters of an attachment between two organs."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from schemas.quantity import Length, Pressure, Toughness
from schemas.scenario import Name

__all__ = ["AttachmentParams"]


class AttachmentParams(BaseModel):
    """Connective tissue between the surfaces of two organs. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    organs: tuple[Name, Name] = Field(
        description=(
            "nodes of the first are tied to faces of the second: state the organ with the finer mesh first"
        )
    )
    surface: str | None = Field(
        default=None,
        description="part of the first organ's surface that is tied, by name; default: all of it",
    )
    within: Length = Field(
        default=1e-3, gt=0, le=0.02, description="largest distance at rest between what is tied"
    )
    strength: Pressure = Field(
        default=20e3,
        gt=0,
        le=1e8,
        description="largest pull or shear over area; default: of areolar tissue, assumed",
    )
    toughness: Toughness = Field(
        default=50.0,
        gt=0,
        le=1e5,
        description=(
            "work of separation over area: surfaces are apart at 2 toughness / strength; default: assumed"
        ),
    )

    @model_validator(mode="after")
    def _two_organs(self) -> Self:
        if self.organs[0] == self.organs[1]:
            raise ValueError(f"'{self.organs[0]}' cannot be attached to itself: state two organs")
        return self
