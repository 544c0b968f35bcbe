"""Motion with least jerk from rest to rest (Flash and Hogan, 1985)."""

from __future__ import annotations

__all__ = ["PEAK_ACCELERATION", "PEAK_SPEED", "least_jerk"]

PEAK_SPEED, PEAK_ACCELERATION = 1.875, 5.774
"""Largest speed and acceleration over a length of 1 in a time of 1."""


def least_jerk(share: float) -> float:
    """Return the share of the way after a share of the time."""
    return share**3 * (10.0 + share * (6.0 * share - 15.0))
