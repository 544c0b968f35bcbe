"""Parameters of an electrosurgical instrument."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Power

__all__ = ["EnergyParams"]


class EnergyParams(BaseModel):
    """The current of a generator through the spheres of a probe. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    mode: Literal["monopolar", "bipolar"] = Field(
        default="monopolar",
        description=(
            "from the touching spheres to a far plate, or from the first half of the spheres (a jaw) to the"
            " second half"
        ),
    )
    effect: Literal["coag", "cut"] = Field(
        default="coag",
        description=(
            "coag: tissue dries and chars, and goes at 500 degrees; cut: steam takes tissue away as soon as"
            " the current has dried it, as arcs above 200 V do (Koninckx et al. 2024)"
        ),
    )
    bare: int | None = Field(
        default=None,
        ge=1,
        description="how many of the first spheres conduct, the others being insulated; default: all",
    )
    power: Power = Field(
        default=60.0, gt=0, le=400, description="most power of the generator; a higher command is cut down"
    )
    efficiency: float = Field(
        default=0.5,
        gt=0,
        le=1,
        description="share of the power that heats tissue within reach; assumed, not measured",
    )
