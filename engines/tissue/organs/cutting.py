"""Parameters of tissue that may be divided."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Toughness

__all__ = ["CuttingParams"]


class CuttingParams(BaseModel):
    """Limits up to which tissue holds. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    toughness: Toughness = Field(
        default=164.0,
        gt=0,
        le=1e5,
        description=(
            "work per area of cut by a sharp edge; default: bovine liver under needles (Gokgol, Basdogan,"
            " Ovali, Med. Eng. Phys. 34, 2012: 164 +- 6 J/m^2)"
        ),
    )
    tear_stretch: float | None = Field(
        default=None,
        gt=1.05,
        le=10.0,
        description=(
            "largest principal stretch that the tissue bears; beyond it faces tear open; default: none tear"
        ),
    )
