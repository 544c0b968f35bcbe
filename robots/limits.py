"""Limits of commanded numbers: how they are compared, and how the numbers are written in an error.

A number beyond a limit by no more than the tolerance is accepted and clamped to the limit.
"""

from __future__ import annotations

__all__ = ["ANGLE_TOLERANCE", "TOLERANCE", "distinct"]

ANGLE_TOLERANCE = 1e-5
"""rad by which a number may be beyond its limit.

The tables of the dVRK state limits with five decimals or six digits: 80 degrees, 1.3962634 rad, as 1.39626.
"""
TOLERANCE = 1e-6
"""The same for every other quantity: m, N, N m, and shares without a unit."""

_EXACT = 17
"""Significant digits that distinguish any two numbers of 64 bits."""


def distinct(value: float, *limits: float, digits: int = 6) -> list[str]:
    """Return `value` and `limits` as text, with enough digits that the value differs from every limit.

    Args:
        value: the number that was refused.
        limits: the numbers with which it was compared.
        digits: significant digits, unless more are needed.
    """
    for count in range(digits, _EXACT):
        first, *others = [f"{number:.{count}g}" for number in (value, *limits)]
        if first not in others:
            return [first, *others]
    return [f"{number:.{_EXACT}g}" for number in (value, *limits)]
