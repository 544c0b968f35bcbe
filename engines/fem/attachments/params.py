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

    lower_end: tuple[Length, Length, Length] | None = Field(
        default=None,
        description=(
            "point in `world` near which dissection begins; with it there is an output"
            " `<attachment>/lower_third`: share that is free of the third of the area nearest to it"
        ),
    )
    opened: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="share of the area, from lower_end on, free from the beginning: dissected already",
    )

    @model_validator(mode="after")
    def _opened_from_an_end(self) -> Self:
        if self.opened and self.lower_end is None:
            raise ValueError("opened counts from an end: state lower_end")
        return self

    @model_validator(mode="after")
    def _two_organs(self) -> Self:
        if self.organs[0] == self.organs[1]:
            raise ValueError(f"'{self.organs[0]}' cannot be attached to itself: state two organs")
        return self
