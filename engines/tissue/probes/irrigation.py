"""Parameters of irrigation."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Length, VolumeFlow

__all__ = ["IrrigationParams"]


class IrrigationParams(BaseModel):
    """Saline let out at the first sphere of a probe. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rate: VolumeFlow = Field(default=10e-6, gt=0, le=1e-3, description="most saline let out; assumed")
    reach: Length = Field(
        default=6e-3,
        gt=0,
        le=0.05,
        description="from the surface of the first sphere to the surface that gets the saline",
    )
