"""Materials of organs by name, each with source and loading of the measurement.

Values for a tissue differ a thousandfold between indentation and tension to failure: the choice depends on
the scenario. Tissue is nearly incompressible; all presets have a Poisson ratio of 0.4, as linear tetrahedra
lock near 0.5.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter

from schemas.errors import did_you_mean
from schemas.quantity import Density, Pressure

__all__ = ["Preset", "TissueDensity", "TissueModulus", "TissuePoissonRatio", "preset", "presets"]


def _between(low: float, high: float, unit: str, reason: str) -> AfterValidator:
    def check(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"{value:g}{unit} is outside {low:g} .. {high:g}{unit}: {reason}")
        return value

    return AfterValidator(check)


TissueModulus = Annotated[
    Pressure,
    _between(
        100.0,
        1e7,
        " Pa",
        "the softest tissue (brain) has some 100 Pa, the stiffest organs' walls and capsules some MPa",
    ),
]
TissuePoissonRatio = Annotated[
    float,
    _between(
        0.01,
        0.495,
        "",
        "tissue is nearly incompressible (0.5), which this model cannot be; 0.3 to 0.49 are usual",
    ),
]
TissueDensity = Annotated[
    Density, _between(200.0, 2000.0, " kg/m^3", "inflated lung has some 250 kg/m^3, bone 1900 kg/m^3")
]


class Preset(BaseModel):
    """A material with sources of its numbers and loading of the measurement. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    young_modulus: TissueModulus
    poisson_ratio: TissuePoissonRatio
    density: TissueDensity
    loading: str = Field(min_length=1)
    source: str = Field(min_length=1)


@cache
def presets() -> dict[str, Preset]:
    """Return all presets by name."""
    return TypeAdapter(dict[str, Preset]).validate_json(
        (Path(__file__).parent / "materials.json").read_bytes()
    )


def preset(name: str) -> Preset:
    """Return a preset. Raises ValueError for an unknown name."""
    if name not in presets():
        raise ValueError(
            f"no material '{name}'.{did_you_mean(name, presets())} Or give young_modulus, poisson_ratio and"
            " density"
        )
    return presets()[name]
