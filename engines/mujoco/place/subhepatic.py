"""The space below a liver that is held up: what surrounds Calot's triangle in the view of a surgeon.

The liver goes on beside and behind the organ that is simulated. The hepatoduodenal ligament, a fold of
peritoneum with fat, hides the ends of ducts and vessels; duodenum and omentum lie caudally. Shapes are by
eye, after pictures of the operation, about the origin of a patient (`anatomy.layout`), where x is to the
patient's left, y cranial, z anterior.
"""

from __future__ import annotations

import numpy as np

from engines.mujoco.place.abdomen import make_wall
from engines.mujoco.place.bowel import bowel_tube
from engines.mujoco.place.part import PlacePart, ripple, sheet
from engines.mujoco.textures.tissues import TISSUES, fatty_peritoneum
from schemas.vectors import Vector

__all__ = ["make_subhepatic"]

_RADIUS, _HEIGHT = 0.26, 0.22
"""Radius and height of the abdominal wall, m."""
_DEEP = -0.045
"""Lowest place of the omentum, below the liver's face, m."""
_HOLLOW = -0.034
"""Lowest place of the ligament, below the liver's face, m."""


def make_subhepatic(low: Vector, high: Vector, seed: int = 0) -> list[PlacePart]:
    """Return the surroundings of a liver in a box from `low` to `high`, m; `seed`: of all shapes."""
    middle = np.array([0.5 * (low[0] + high[0]), 0.0, low[2]])
    return [
        make_wall(middle, _RADIUS, _HEIGHT, seed),
        _liver(low, high, seed),
        _ligament(seed),
        _omentum(seed),
        _duodenum(seed),
    ]


def _rise(values: Vector, low: float, high: float) -> Vector:
    """Return 0 below `low`, 1 above `high`, and a smooth way between; `low` may be above `high`."""
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def _liver(low: Vector, high: Vector, seed: int) -> PlacePart:
    """The lobe about the liver's face, from its sharp caudal edge up to the diaphragm."""
    left, right, bottom, top = low[0] - 0.11, high[0] + 0.09, low[1] - 0.004, high[1] + 0.11

    def place(u: Vector, v: Vector) -> Vector:
        x, y = left + u * (right - left), bottom + v * (top - bottom)
        beside = np.maximum(low[0] + 0.016 - x, x - high[0] + 0.016)
        cranial = y - high[1] + 0.014
        outside = _rise(np.maximum(beside, cranial), -0.018, 0.006)
        lobe = -0.037 + 0.018 * _rise(y, 0.0, 0.045) + 0.026 * _rise(beside, -0.01, 0.09)
        lobe += 0.85 * np.maximum(cranial, 0.0)
        lobe += 0.004 * ripple(x, y, 0.05, 11 + seed) - 0.022 * _rise(y, bottom + 0.03, bottom)
        z = (low[2] - 0.01) + outside * (lobe - low[2] + 0.01)
        return np.stack([x, y, z], axis=1)

    return sheet(place, (right - left, top - bottom), (64, 56), TISSUES["liver"], 0.06)


def _ligament(seed: int) -> PlacePart:
    """Fold of peritoneum about the common duct, to the liver's hilum."""

    def place(u: Vector, v: Vector) -> Vector:
        x, y = -0.012 + 0.102 * u, -0.075 + 0.125 * v
        edge = x + 0.002 * ripple(x, y, 0.022, 17 + seed) + 0.25 * np.maximum(-0.012 - y, 0.0)
        fold = _rise(edge, -0.006, 0.020) ** 1.3
        hilum = np.exp(-((x - 0.016) ** 2 + (y - 0.031) ** 2) / (2.0 * 0.006**2))
        share = 1.0 - (1.0 - fold) * (1.0 - hilum)
        ridge = -0.0065 - 0.0015 * np.exp(-(((x - 0.020) / 0.006) ** 2)) - 0.12 * np.maximum(x - 0.028, 0.0)
        ridge -= 0.030 * _rise(y, 0.018, 0.050) * _rise(x, 0.016, 0.030)
        bumps = 0.0012 * ripple(x, y, 0.016, 12 + seed) + 0.0006 * ripple(x, y, 0.006, 13 + seed)
        return np.stack([x, y, _HOLLOW + share * (ridge + bumps - _HOLLOW)], axis=1)

    return sheet(place, (0.115, 0.125), (60, 66), fatty_peritoneum, 0.04)


def _omentum(seed: int) -> PlacePart:
    """Fat caudally of the liver's edge."""

    def place(u: Vector, v: Vector) -> Vector:
        x, y = -0.20 + 0.40 * u, -0.17 + 0.16 * v
        share = _rise(y + 0.004 * ripple(x, y, 0.04, 14 + seed), -0.014, -0.044)
        lobes = 0.004 * ripple(x, y, 0.03, 15 + seed) + 0.0018 * ripple(x, y, 0.011, 16 + seed)
        return np.stack([x, y, _DEEP + share * (-0.016 + lobes - _DEEP)], axis=1)

    return sheet(place, (0.40, 0.16), (110, 44), TISSUES["fat"], 0.09)._replace(layer=1)


def _duodenum(seed: int) -> PlacePart:
    """Upper bend of the duodenum, from the pylorus on the patient's left to the right and down."""
    steps = np.linspace(0.0, 1.0, 90)
    x = 0.075 - 0.125 * steps
    y = -0.062 + 0.012 * np.sin(np.pi * steps) - 0.05 * np.maximum(steps - 0.6, 0.0) ** 1.5
    z = -0.024 + 0.010 * np.sin(np.pi * steps)
    return bowel_tube(np.stack([x, y, z], axis=1), 0.0145, 32, 7 + seed)
