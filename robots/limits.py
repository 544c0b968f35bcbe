"""Limits of commanded numbers: comparison with tolerance, and the text of numbers in an error.

A number beyond a limit by no more than the tolerance is accepted and clamped to the limit.
"""

from __future__ import annotations

__all__ = ["ANGLE_TOLERANCE", "TOLERANCE", "distinct"]

ANGLE_TOLERANCE = 1e-5
"""Tolerance of an angle beyond its limit, rad.

The tables of the dVRK state limits with five decimals or six digits: 80 degrees, 1.3962634 rad, as 1.39626.
"""
TOLERANCE = 1e-6
"""Tolerance of all quantities but angles: m, N, N m, and fractions."""

_EXACT = 17
"""Significant digits enough to distinguish any two numbers of 64 bits."""


def distinct(value: float, *limits: float, digits: int = 6) -> list[str]:
    """Return `value` and `limits` as text, with enough digits to tell the value from every limit.

    Args:
        value: the refused number.
        limits: the limits of the number.
        digits: significant digits, unless more are needed.
    """
    for count in range(digits, _EXACT):
        first, *others = [f"{number:.{count}g}" for number in (value, *limits)]
        if first not in others:
            return [first, *others]
    return [f"{number:.{_EXACT}g}" for number in (value, *limits)]
