"""The file of a user's own tissue, written by `trocar calibrate tissue` and named in a scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field

from engines.tissue.organs.materials import TissueDensity, TissueModulus, TissuePoissonRatio
from engines.tissue.organs.prony import PronySeries
from schemas.yaml_model import load_yaml_model, yaml_text

__all__ = ["MaterialFile"]

_LARGEST = 2**16
"""Most bytes of a file; a usual file has 1 KiB."""


class MaterialFile(BaseModel):
    """The content of a YAML file, SI units: constants of Bullet's material, and their provenance."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    young_modulus: TissueModulus
    """Storage modulus of the tissue at the frequency of `fit`, Pa."""
    poisson_ratio: TissuePoissonRatio
    density: TissueDensity
    damping: Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
    """Ratio of damping to stiffness, s, for the loss at the frequency of `fit`."""
    friction: Annotated[float, Field(ge=0.0, le=2.0, allow_inf_nan=False)] | None = None
    """Coulomb's coefficient; None: not measured."""
    long_term_young_modulus: TissueModulus | None = None
    """Young's modulus when all of `prony` has relaxed, Pa; None: no relaxation."""
    prony: PronySeries = ()
    """Relaxation, instead of `young_modulus` and `damping` at a single frequency: for kind fem."""
    fit: dict[str, Any] = Field(default_factory=dict[str, Any])
    """Measured values with deviations, and quality of the fit; for the reader."""

    @classmethod
    def load(cls, file: Path) -> Self:
        """Return the content of `file`. Raises ValueError for an unreadable or invalid file."""
        return load_yaml_model(
            cls, file, largest=_LARGEST, writer="trocar calibrate tissue", error=ValueError
        )

    def text(self) -> str:
        """Return the content as YAML."""
        return yaml_text(self)
