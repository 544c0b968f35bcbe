"""Parameters of clips and ligatures."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from schemas.quantity import Length

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

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not 0.0 < self.diameters[0] <= self.diameters[1]:
            raise ValueError(f"diameters {list(self.diameters)}: state the least, then the largest")
        return self
