"""Parameters of clips and ligatures."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from schemas.quantity import Force, Length

__all__ = ["ClipParams"]


class ClipParams(BaseModel):
    """A clip between the two jaws of a probe, or a ligature of another width. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    length: Length = Field(
        default=11e-3,
        gt=0,
        le=0.1,
        description="along the jaws: a tube wider than this, when flat, slips out",
    )
    width: Length = Field(default=1.2e-3, gt=0, le=0.02, description="along the tube that it shuts; assumed")
    diameters: tuple[Length, Length] = Field(
        default=(3.5e-3, 7e-3),
        description=(
            "least and largest outer diameter of tubes that it holds; default: a titanium clip of size"
            " medium-large (tested on arteries by Schenk et al., Innov. Surg. Sci. 1, 2016)"
        ),
    )

    hold_along: Force = Field(
        default=4.4,
        gt=0,
        description=(
            "pull along the tube at which a clip comes off; default: middle of 4.08 to 4.78 N of metal"
            " clips on silicone tubes (Nelson et al., Arch. Surg. 127, 1992)"
        ),
    )
    hold_across: Force = Field(
        default=2.2,
        gt=0,
        description="the same across the tube; default: middle of 1.81 to 2.68 N (as above)",
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not 0.0 < self.diameters[0] <= self.diameters[1]:
            raise ValueError(f"diameters {list(self.diameters)}: state the least, then the largest")
        return self
