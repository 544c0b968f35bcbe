"""Thermal constants of tissues.

Sources and open questions: docs/decisions/0130-heat-in-tissue.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from schemas.vectors import Vector

__all__ = ["BODY", "BOILING", "CHARRING", "TISSUES", "VAPORISING", "HeatTissue", "tissue_of"]

BODY = 37.0
"""Temperature of the body, degrees C."""
BOILING = 100.0
"""Temperature at which water leaves, degrees C."""
CHARRING = 200.0
"""Temperature of a dry residue that turns to char, degrees C."""
VAPORISING = 500.0
"""Temperature of a dry residue that is gone, degrees C."""
_LEAST_DAMAGING = 43.0
"""Least temperature of damage, degrees C: by its law, liver would die at 37 degrees within an hour."""
_LATENT_HEAT = 2.257e6
"""Latent heat of water, J/kg."""
_BLOOD = 1050.0 * 3617.0
"""Heat capacity of blood, J/(m^3 K)."""
_DRY_SPECIFIC_HEAT = 1500.0
"""Specific heat of proteins and char, J/(kg K); assumed."""
_GAS_CONSTANT = 8.314463
_WHITENING = log(2.083662e10 * 333.15) + 553.5 / _GAS_CONSTANT, 2.768e5 / _GAS_CONSTANT
"""Pig liver turns white: entropy and enthalpy of Jacques, Newman, He (ASME, 1991), at 60 degrees C.

Logarithm of the frequency factor (1/s), and activation energy over the gas constant (K).
"""
_DEATH = log(7.39e39), 2.577e5 / _GAS_CONSTANT
"""Liver cells die: the set in wide use for radiofrequency ablation; units as above."""


@dataclass(frozen=True)
class HeatTissue:
    """Thermal constants of a tissue."""

    density: float
    """kg/m^3."""
    specific_heat: float
    """J/(kg K)."""
    conductivity: float
    """W/(m K)."""
    perfusion: float
    """Flow of blood, ml/min per kg."""
    water: float
    """Mass of water over mass."""

    @property
    def capacity(self) -> float:
        """Heat capacity, J/(m^3 K)."""
        return self.density * self.specific_heat

    @property
    def blood_flow(self) -> float:
        """Perfusion, m^3/(s kg)."""
        return 1e-6 / 60.0 * self.perfusion

    @property
    def residue(self) -> float:
        """Mass without water, kg/m^3."""
        return self.density * (1.0 - self.water)

    @property
    def dry_capacity(self) -> float:
        """Heat capacity without water, J/(m^3 K)."""
        return self.residue * _DRY_SPECIFIC_HEAT

    @property
    def steam_per_joule(self) -> float:
        """Mass of water boiled off by heat, kg/J."""
        return 1.0 / _LATENT_HEAT

    @property
    def constants(self) -> Vector:
        """Numbers of `Tissue` in `_heat.c`."""
        return np.array(
            [
                self.capacity,
                self.conductivity,
                self.blood_flow * self.density * _BLOOD,
                self.density * self.water * _LATENT_HEAT,
                self.dry_capacity,
                self.residue,
                BODY,
                BOILING - BODY,
                CHARRING - BODY,
                VAPORISING - BODY,
                _LEAST_DAMAGING - BODY,
                *_WHITENING,
                *_DEATH,
            ]
        )


TISSUES = {
    "liver": HeatTissue(1079.0, 3540.0, 0.52, 860.0, 0.72),
    "gallbladder": HeatTissue(1071.0, 3716.0, 0.52, 30.0, 0.75),
    "kidney": HeatTissue(1066.0, 3763.0, 0.53, 3795.0, 0.77),
    "bowel": HeatTissue(1030.0, 3595.0, 0.49, 1026.0, 0.75),
    "muscle": HeatTissue(1090.0, 3421.0, 0.49, 37.0, 0.75),
    "fat": HeatTissue(911.0, 2348.0, 0.21, 33.0, 0.2),
    "vessel": HeatTissue(1102.0, 3306.0, 0.46, 150.0, 0.7),
}
"""Tissues by name."""


def tissue_of(material: str | None) -> HeatTissue:
    """Return the constants for a material of an organ; liver's for an unknown material."""
    name = (material or "").split("-")[0]
    return TISSUES.get("bowel" if name == "colon" else name, TISSUES["liver"])
