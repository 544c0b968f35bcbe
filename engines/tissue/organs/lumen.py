"""Parameters of the lumen of a tube."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.organs.picks import Point
from schemas.quantity import Pressure, Volume, VolumeFlow

__all__ = ["LumenParams"]

_MMHG = 133.322


class LumenParams(BaseModel):
    """Liquid under pressure in a tube. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    line: tuple[Point, ...] = Field(
        default=(),
        max_length=200,
        description=(
            "points of the centre line of a hollow mesh, in the organ's own frame, from its left end to its"
            " right; that of a `tube` is known"
        ),
    )
    liquid: Literal["blood", "bile"] = "blood"
    pressure: Pressure = Field(
        default=78.0 * _MMHG,
        ge=0,
        le=1e5,
        description=(
            "over that around the tube; default: middle of the mean arterial pressures of 65 to 90 mmHg. A"
            " bile duct has some 10 mmHg"
        ),
    )
    volume: Volume | None = Field(
        default=None,
        gt=0,
        le=1e-2,
        description=(
            "liquid of a sac without a supply, such as a gallbladder: the pressure falls with what is left,"
            " and the flow ends when the sac is empty; default: supplied without end"
        ),
    )
    supply: tuple[Literal["left", "right"], ...] = Field(
        default=("left", "right"), min_length=1, max_length=2, description="ends through which liquid comes"
    )
    reserve: Volume | None = Field(
        default=None,
        gt=0,
        le=1e-2,
        description=(
            "liquid behind the left end, such as that of the gallbladder behind a cystic duct: the pressure"
            " there falls with what is left; default: supplied without end"
        ),
    )
    most_flow: VolumeFlow | None = Field(
        default=None,
        gt=0,
        description="most that comes through an end, as of the artery before; default: any",
    )

    @model_validator(mode="after")
    def _a_line(self) -> Self:
        if len(self.line) == 1 or any(one == other for one, other in pairwise(self.line)):
            raise ValueError("the line of a lumen has two points at least, each apart from the one before")
        return self
