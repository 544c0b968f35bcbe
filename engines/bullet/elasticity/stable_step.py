"""The longest time step of a mesh in Bullet."""

from __future__ import annotations

from math import sqrt

__all__ = ["ACCURATE_PHASE", "face_loss", "longest_step"]

_LARGEST_PHASE = 4.0
"""Largest timestep x highest frequency.

A block pressed at a node is stable at 4.0 and chatters at 4.7 (elasticity/test_limits.py in the tests).
"""


ACCURATE_PHASE = 1.7
"""Largest timestep x highest frequency for a contact force within 10 %."""
_FACE_COMPLIANCE = 0.042
"""Extra relative sinking of a sphere into a face at a phase of 1, growing with the square of the phase. On
coarse meshes; with 250 nodes 0.031 (`bench/tissue_step.py`).
"""


def face_loss(phase: float) -> float:
    """Return the largest relative loss of force of a contact in a face of the mesh.

    `phase`: timestep x highest frequency. Contacts at nodes lose next to nothing, held nodes nothing.
    """
    sinking = _FACE_COMPLIANCE * phase**2
    return sinking / (1.0 + sinking)


def longest_step(frequency: float, damping: float) -> float:
    """Return the longest stable time step (s) of Bullet's integration scheme.

    The scheme is explicit in elasticity and implicit in damping, then moves the positions. For a mode of
    angular frequency w: v' = (v - h w^2 x) / (1 + h d w^2), x' = x + h v'. The roots leave the unit circle at
    h^2 w^2 > 4 + 2 h d w^2, so d >= h / 2 keeps any frequency stable. Contacts are solved before the damping,
    and chatter at too large an h w.
    """
    return min(damping + sqrt(damping**2 + 4.0 / frequency**2), _LARGEST_PHASE / frequency)
