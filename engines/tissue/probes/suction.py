"""Parameters of suction."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Length, VolumeFlow

__all__ = ["SuctionParams"]


class SuctionParams(BaseModel):
    """Blood taken up at the spheres of a probe. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rate: VolumeFlow = Field(
        default=30e-6, gt=0, le=1e-3, description="most liquid taken up by all spheres together; assumed"
    )
    reach: Length = Field(
        default=4e-3, gt=0, le=0.05, description="from the surface of a sphere to the blood that it takes up"
    )
