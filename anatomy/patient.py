"""A patient: sizes and stiffness of the organs about Calot's triangle, drawn from published figures."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import Literal

from anatomy.spread import Spread

__all__ = ["GALLBLADDER_LENGTH", "ArteryCourse", "Patient", "Variations", "draw_patient"]

ArteryCourse = Literal["cranial", "front", "behind"]
"""Course of the cystic artery about the cystic duct."""

GALLBLADDER_LENGTH = Spread(0.085, 0.008, 0.070, 0.100)
"""Fasting: 70 to 100 mm (StatPearls; The Common Vein); the deviation is assumed."""
GALLBLADDER_WIDTH = Spread(0.029, 0.0025, 0.024, 0.034)
"""24 to 34 mm in ultrasound of 400 adults (Zanco J. Med. Sci.); the deviation is assumed."""
GALLBLADDER_WALL = Spread(0.0025, 0.0002, 0.0021, 0.0030)
"""Means of 2.46 to 2.53 mm in ultrasound, 2.16 to 2.96 found, normal up to 3 mm (as above)."""
THICK_WALL = Spread(0.0045, 0.0005, 0.0035, 0.0055)
"""Inflamed: above 3 mm is thickened; mean and deviation are assumed."""
DUCT_LENGTH = Spread(0.0274, 0.004, 0.020, 0.035)
"""27.4 mm (80 dissections: Marniok 1999), about 20 mm (55 studies: Priya et al. 2023); deviation assumed."""
SHORT_DUCT_LENGTH = Spread(0.012, 0.0015, 0.010, 0.014)
"""Assumed: room for three clips and a cut, 8.2 mm, and half a jaw at each end."""
DUCT_LUMEN = Spread(0.00284, 0.0004, 0.0022, 0.0036)
"""2.84 mm (80 dissections: Marniok 1999), taken as the lumen; the deviation is assumed."""
DUCT_WALL = 0.0011
"""Assumed."""
ARTERY_LENGTH = Spread(0.0220, 0.003, 0.0169, 0.0271)
"""16.9 mm, 2 to 55 mm found (82 bodies: doi:10.1155/2016/7201858); 27.1 mm to its branching (Marniok 1999):
between them.
"""
ARTERY_LUMEN = Spread(0.0018, 0.0002, 0.0016, 0.0024)
"""1.6 mm, 1 to 5 mm found (as above); those that a clip of medium-large size holds."""
ARTERY_WALL = 0.0010
"""With its sheath; assumed. The wall alone, a tenth of the diameter, needs sub-steps of 5 us."""
COMMON_DUCT_DIAMETER = Spread(0.0070, 0.0006, 0.0060, 0.0085)
"""3 to 9 mm (Priya et al. 2023); the deviation is assumed."""
COMMON_DUCT_WALL = 0.0013
"""Assumed."""
HEPATIC_ARTERY_DIAMETER = 0.0050
HEPATIC_ARTERY_WALL = 0.0011
"""Assumed."""

LIVER_MODULUS = Spread(6400.0, 840.0, 4110.0, 7980.0)
"""Three times the shear modulus of 2.14 +- 0.28 kPa, 1.37 to 2.66 kPa found (Obrzut et al. 2019)."""
GALLBLADDER_MODULUS = Spread(40e3, 6e3, 30e3, 55e3)
"""Assumed, soft enough for real time: steep parts of human walls have 255 to 641 kPa (Karimi et al. 2017,
from memory), walls of pigs 9 MPa at 500 %/s (Johnson et al. 2020).
"""
DUCT_MODULUS = Spread(60e3, 8e3, 45e3, 75e3)
"""Small strains of the porcine common bile duct along its length: some 46 kPa, as it is 25 % longer at 5 kPa
with a diameter of 9 mm (Duch et al. 2004) and a wall of 1 mm; deviation assumed.
"""
ARTERY_MODULUS = Spread(60e3, 6e3, 45e3, 75e3)
"""Such that a pull meets what the thin wall of a muscular artery (0.3 to 1 MPa, from memory) has: modulus
times cross-section is 0.3 to 0.9 N.
"""
INFLAMED = 1.4
"""Modulus of an inflamed wall over that of a healthy wall; assumed."""

_COURSES: tuple[tuple[ArteryCourse, float], ...] = (("front", 0.15), ("behind", 0.15))
"""Published: superomedial 94.7 %, posteromedial 0.5 %, anterior 0.3 % of 1850. Drawn more often here, so that
few patients show all."""
_SHORT, _THICK = 0.2, 0.25
"""Shares of patients with a short duct and with an inflamed wall: drawn more often than they are."""
_STONE = 0.119
"""Share of patients with a stone in the neck: 612 of 5136 (Khan et al., JSLS 24(3), 2020)."""


@dataclass(frozen=True)
class Variations:
    """Variations of a patient; None: as the seed draws it."""

    artery: ArteryCourse | None = None
    short_duct: bool | None = None
    thick_wall: bool | None = None
    stone: bool | None = None


@dataclass(frozen=True)
class Patient:
    """Sizes (m) and moduli (Pa)."""

    gallbladder_length: float
    gallbladder_width: float
    gallbladder_wall: float
    duct_length: float
    duct_diameter: float
    artery_length: float
    artery_diameter: float
    common_duct_diameter: float
    liver_modulus: float
    gallbladder_modulus: float
    duct_modulus: float
    artery_modulus: float
    artery: ArteryCourse
    short_duct: bool
    thick_wall: bool
    stone: bool
    """A stone fills the neck."""


def draw_patient(seed: int, variations: Variations) -> Patient:
    """Return the patient of a seed. A stated variation changes nothing that it does not concern."""
    random = Random(seed)
    course = _draw_course(random.random())
    short, thick = random.random() < _SHORT, random.random() < _THICK
    artery = variations.artery or course
    is_short = short if variations.short_duct is None else variations.short_duct
    is_thick = thick if variations.thick_wall is None else variations.thick_wall
    sizes = [Random(random.random()) for _ in range(12)]
    stone = random.random() < _STONE
    wall = (THICK_WALL if is_thick else GALLBLADDER_WALL).draw(sizes[2])
    return Patient(
        gallbladder_length=GALLBLADDER_LENGTH.draw(sizes[0]),
        gallbladder_width=GALLBLADDER_WIDTH.draw(sizes[1]),
        gallbladder_wall=wall,
        duct_length=(SHORT_DUCT_LENGTH if is_short else DUCT_LENGTH).draw(sizes[3]),
        duct_diameter=DUCT_LUMEN.draw(sizes[4]) + 2.0 * DUCT_WALL,
        artery_length=ARTERY_LENGTH.draw(sizes[5]),
        artery_diameter=ARTERY_LUMEN.draw(sizes[6]) + 2.0 * ARTERY_WALL,
        common_duct_diameter=COMMON_DUCT_DIAMETER.draw(sizes[7]),
        liver_modulus=LIVER_MODULUS.draw(sizes[8]),
        gallbladder_modulus=GALLBLADDER_MODULUS.draw(sizes[9]) * (INFLAMED if is_thick else 1.0),
        duct_modulus=DUCT_MODULUS.draw(sizes[10]),
        artery_modulus=ARTERY_MODULUS.draw(sizes[11]),
        artery=artery,
        short_duct=is_short,
        thick_wall=is_thick,
        stone=stone if variations.stone is None else variations.stone,
    )


def _draw_course(share: float) -> ArteryCourse:
    for course, part in _COURSES:
        if share < part:
            return course
        share -= part
    return "cranial"
