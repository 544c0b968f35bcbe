"""Numbers as people read them: four digits, a unit with a fitting prefix; counted things."""

from __future__ import annotations

from math import isfinite

__all__ = ["counted", "label", "readable"]

_SMALLER = {
    "m": (1e3, "mm"),
    "m^2": (1e6, "mm²"),
    "m^3": (1e9, "mm³"),
    "m/s": (1e3, "mm/s"),
    "N": (1e3, "mN"),
    "J": (1e3, "mJ"),
}
"""Factor and name of the unit for values below a limit, by SI unit."""
_LIMIT = {"m": 1.0, "m^2": 1e-2, "m^3": 1e-5, "m/s": 1.0, "N": 0.1, "J": 0.1}
"""Smallest values shown in the SI unit itself."""


def readable(value: float, unit: str = "") -> str:
    """Return a value in an SI unit as text: 0.02528 and `m` give `25.28 mm`."""
    if not isfinite(value):
        return f"{value} {unit}".rstrip()
    if unit in _SMALLER and 0.0 < abs(value) < _LIMIT[unit]:
        factor, unit = _SMALLER[unit]
        value *= factor
    digits = f"{value:.0f}" if value == round(value) or 1e4 <= abs(value) < 1e9 else f"{value:.4g}"
    return f"{digits} {unit}".rstrip()


def label(name: str, unit: str) -> str:
    """Return the name of a measure as text, without its unit: `lift_m` and `m` give `lift`."""
    short = name.removesuffix(f"_{unit.lower()}") if unit else name
    return short.replace("_", " ")


def counted(number: int, noun: str) -> str:
    """Return a number of things: `1 late step`, `2 late steps`; the plural ends in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
