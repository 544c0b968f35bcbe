"""The drive of a joint, and a disc of an instrument, coupled to several joints.

Sources: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68), share/pid/sawControllersPID-PSM.json. SI
units, radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np

from schemas.vectors import Vector

__all__ = ["JAW_COLUMN", "SMOOTHING", "Disc", "Drive", "disc_shares"]

SMOOTHING = 50.0
"""s/rad, s/m: FONT's Coulomb friction is Fs tanh(50 dq) (`robots.dvrk.drives`)."""

JAW_COLUMN = 3
"""Column of the jaw in `disc_shares`, after roll, wrist pitch and wrist yaw."""
_ROUNDING = 1e-9
"""Turn of a disc below this is rounding."""

_STIFFNESS, _DAMPING = 6.0, 0.09
"""N m/rad, N m s/rad of all four discs (SAW)."""
_INERTIA = _DAMPING**2 / (4.0 * _STIFFNESS)
"""kg m^2: neither published identification states a rotor inertia of the discs (FONT has none,
WPI-AIM/dvrk_dynamics_identification finds negative ones); this is the value that the gains damp critically, d
= 2 sqrt(p I).
"""


@dataclass(frozen=True)
class Drive:
    """The drive of a joint; rad, N m and kg m^2, or m, N and kg."""

    stiffness: float
    """Proportional gain of the servo."""
    damping: float
    """Derivative gain, on the error of the velocity."""
    viscous_friction: float
    """Effort per velocity; 0 where the discs have the friction."""
    coulomb_friction: float
    """Effort; 0 where the discs have the friction."""
    elasticity: float
    """Effort per position: the joint asks for elasticity * q + offset."""
    offset: float
    armature: float
    """Inertia of the drive beside the bodies' own."""
    effort: float
    """Largest effort."""
    velocity: float
    """Largest velocity."""
    smoothing: float = SMOOTHING
    """Slope of Coulomb friction at rest, s/rad or s/m."""
    static_friction: float = 0.0
    """Effort at rest beyond Coulomb's friction (Stribeck)."""
    stribeck_velocity: float = inf
    """Velocity of a fall of static friction to 1/e."""

    @classmethod
    def of_disc(
        cls, share: float, effort: float, velocity: float, elasticity: float = 0.0, offset: float = 0.0
    ) -> Drive:
        """Return the drive of a joint turned by discs.

        Args:
            share: sum over the discs of the square of their turn (rad) for a unit of the joint.
            effort: largest effort of the joint.
            velocity: largest velocity of the joint.
            elasticity: effort per position.
            offset: effort at position 0.
        """
        gains = _STIFFNESS * share, _DAMPING * share
        return cls(*gains, 0.0, 0.0, elasticity, offset, _INERTIA * share, effort, velocity)


@dataclass(frozen=True)
class Disc:
    """A disc of an instrument: turn = sum over the joints of share * position; rad, N m."""

    shares: Mapping[str, float]
    viscous_friction: float
    coulomb_friction: float
    smoothing: float = SMOOTHING
    static_friction: float = 0.0
    stribeck_velocity: float = inf


def disc_shares(actuator_to_joint: Vector) -> Vector:
    """Return the turn of each disc for a radian of each joint, shape (disc, joint).

    The inverse of SAW's matrix from discs to joints: roll, wrist pitch, wrist yaw, jaw.
    """
    shares = np.linalg.inv(actuator_to_joint)
    return np.where(np.abs(shares) > _ROUNDING, shares, 0.0)
