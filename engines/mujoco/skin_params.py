"""What a scenario may say about how an organ looks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hub.participant import Params

__all__ = ["COLOURS", "Rgb", "SkinParams"]

Rgb = tuple[Annotated[float, Field(ge=0.0, le=1.0)], Annotated[float, Field(ge=0.0, le=1.0)], Annotated[float, Field(ge=0.0, le=1.0)]]
"""Red, green and blue, each from 0 to 1."""

Tissue = Literal["tissue", "adrenal", "colon", "fat", "kidney", "liver"]

COLOURS: dict[Tissue, Rgb] = {
    "tissue": (0.80, 0.38, 0.33),
    "adrenal": (0.83, 0.60, 0.28),
    "colon": (0.86, 0.55, 0.48),
    "fat": (0.90, 0.76, 0.42),
    "kidney": (0.56, 0.22, 0.18),
    "liver": (0.45, 0.17, 0.13),
}
"""Chosen by eye, for a white lamp at the camera, after what textbooks of anatomy say of the living organ: liver and kidney red-brown, the
liver darker; colon greyish pink; the adrenal gland the yellow of its cortex; `tissue` the pink of muscle."""


class SkinParams(Params):
    """The look of one organ."""

    colour: Tissue | Rgb = Field(default="tissue", description="name of a tissue, or red, green and blue from 0 to 1")

    @property
    def rgb(self) -> Rgb:
        """Red, green and blue, each from 0 to 1."""
        return COLOURS[self.colour] if isinstance(self.colour, str) else self.colour
