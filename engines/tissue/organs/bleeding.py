"""Parameters of tissue that bleeds."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Duration, Length, Perfusion

__all__ = ["BleedingParams"]


class BleedingParams(BaseModel):
    """Flow of blood out of opened tissue. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    perfusion: Perfusion | None = Field(
        default=None,
        ge=0,
        le=1e-3,
        description="flow of blood through living tissue; default: that of the material, liver 860 ml/min/kg",
    )
    depth: Length = Field(
        default=10e-3,
        gt=0,
        le=0.1,
        description=(
            "thickness of the tissue whose flow leaves by a cut: a cut bleeds perfusion times density times"
            " depth times area; assumed"
        ),
    )
    clotting: Duration | None = Field(
        default=None,
        gt=0,
        description=(
            "time after which a cut has stopped by itself, its flow falling evenly; bleeding time of skin:"
            " 2 to 9 min; default: never"
        ),
    )
