"""What the controllers' trajectories keep to, where the sources leave it open."""

from __future__ import annotations

__all__ = ["jerk"]

_RISE = 0.1
"""Time (s) in which a trajectory's acceleration grows from 0 to its limit.

The dVRK's own trajectories (Reflexxes, type II) do not limit jerk; for a choice see docs/decisions/0007.
"""


def jerk(acceleration: float) -> float:
    """Return the jerk limit (rad/s^3, m/s^3) that goes with a limit of the acceleration (rad/s^2, m/s^2)."""
    return acceleration / _RISE
