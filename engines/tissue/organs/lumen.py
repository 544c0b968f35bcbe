"""Parameters of the lumen of a tube."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Pressure, VolumeFlow

__all__ = ["LumenParams"]

_MMHG = 133.322


class LumenParams(BaseModel):
    """Liquid under pressure in a tube. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

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
    supply: tuple[Literal["left", "right"], ...] = Field(
        default=("left", "right"), min_length=1, max_length=2, description="ends through which liquid comes"
    )
    most_flow: VolumeFlow | None = Field(
        default=None,
        gt=0,
        description="most that comes through an end, as of the artery before; default: any",
    )
