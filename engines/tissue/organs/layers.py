"""Layers of a block of tissue, each of one material."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from engines.tissue.material import Material
from engines.tissue.organs.materials import TissueModulus, preset
from schemas.quantity import Length
from schemas.scenario import Name

__all__ = ["BASE", "LayerParams"]

BASE = "base"
"""Name of the tissue below all layers, of the organ's own material."""


class LayerParams(BaseModel):
    """A layer. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name
    thickness: Annotated[Length, Field(gt=0)]
    rows: int | None = Field(
        default=None,
        ge=1,
        le=20,
        description=(
            "rows of cells, for a finer mesh where heat acts; below the layers each row is then half as high"
            " again as the row above; default: by the number of nodes"
        ),
    )
    material: str = Field(description="name of a material that `trocar organs` shows with its source")
    young_modulus: TissueModulus | None = Field(default=None, description="instead of that of the material")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.name == BASE:
            raise ValueError(f"'{BASE}' is the tissue below all layers: take another name")
        _ = preset(self.material)
        return self

    def elastic(self, damping: float) -> Material:
        """Return the material with `damping`, s."""
        known = preset(self.material)
        return Material(
            self.young_modulus or known.young_modulus, known.poisson_ratio, known.density, damping
        )
