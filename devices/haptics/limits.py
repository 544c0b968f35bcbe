"""Limits of a force on a hand, in SI units: the limits of `devices.haptics.safety`, and a device's."""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["TOUCH", "DeviceLimits", "Limits"]

_SHARE_OF_NOMINAL = 0.6
"""Usable share of a device's nominal maximum force: the motors hold the nominal force, a peak, in the best
posture only, and not for long.
"""


@dataclass(frozen=True, slots=True)
class DeviceLimits:
    """Limits of a device, as stated by the maker.

    HDAPI: HD_NOMINAL_MAX_FORCE, _STIFFNESS and _DAMPING, here in SI units.
    """

    force: float
    """N."""
    stiffness: float
    """N/m."""
    damping: float
    """N s/m."""

    @property
    def usable_force(self) -> float:
        """Largest commanded force, N."""
        return _SHARE_OF_NOMINAL * self.force


TOUCH = DeviceLimits(force=3.3, stiffness=400.0, damping=4.0)
"""A 3D Systems Touch (CHAI3D at 7c76b1f2, extras/hdPhantom and src/devices/CPhantomDevices.cpp)."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of a stylus.

    The defaults are the widest allowed, for a device without stated limits. The sources are
    drivers in use: 2 N is the clamp of sawSensablePhantom, waiting for less than 0.2 N is CHAI3D's; 400 N/m
    never oscillated in a simulated hand, 700 N/m did; the times are ours (docs/decisions/0022).
    """

    force: float = 2.0
    """Norm of the force, N."""
    stiffness: float = 400.0
    """Stiffness of all touched planes together, in the stiffest direction, N/m."""
    damping: float = 4.0
    """Damping, likewise, N s/m."""
    slew: float = 0.1
    """Largest growth or turn of the force in a tick, N. The force may fall at once."""
    speed: float = 1.0
    """A faster hand gets no force until the dead-man is released, m/s."""
    hold: float = 0.1
    """Longest silence of the simulation with the full force of the last contact model, s."""
    decay: float = 0.02
    """Time constant of the force's decay after `hold`, s."""
    silence: float = 0.13
    """Silence until zero force, s.

    After a hub's end the force must be zero within 150 ms; the hub's last model and a busy device host may
    take 20 ms of this time.
    """
    ramp: float = 1.0
    """Rise time of the force from zero, s."""
    calm_force: float = 0.2
    """The force rises only after less than this was due ..., N."""
    calm_ticks: int = 4
    """... for this number of ticks."""

    def bound_by(self, device: DeviceLimits) -> Limits:
        """Return these limits, each no larger than the limit of `device`."""
        return replace(
            self,
            force=min(self.force, device.usable_force),
            stiffness=min(self.stiffness, device.stiffness),
            damping=min(self.damping, device.damping),
        )
