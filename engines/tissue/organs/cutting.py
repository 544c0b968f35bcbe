"""Parameters of tissue that may be divided."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

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
            "largest principal stretch that the tissue bears; beyond it a tear begins; default: none does"
        ),
    )
    tear_toughness: Toughness | None = Field(
        default=None,
        gt=0,
        le=1e5,
        description=(
            "work per area at which a tear, or the end of a cut, runs on, with `tear_stretch`: 6 to 15 times"
            " that of a sharp edge in aorta and skin; default: it runs on where the stretch is too large"
        ),
    )

    @model_validator(mode="after")
    def _both_limits(self) -> Self:
        if self.tear_toughness is not None and self.tear_stretch is None:
            raise ValueError("tear_toughness is that of tears: state `tear_stretch`, at which they begin")
        return self
