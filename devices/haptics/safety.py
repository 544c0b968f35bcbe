"""The chain of limits for every force on a hand, tick by tick.

In this order: numbers not finite, silence of the simulation, dead-man and calibration, speed of
the hand, waiting for a small force, norm, ramp, slew. (Stiffness and damping are bounded where planes are
rendered.) Every violation gives zero force at once; then the force rises slowly. The slew is last,
so the bound holds for the force felt by the hand.
"""

from __future__ import annotations

from enum import Enum
from math import exp, hypot, isfinite

from devices.haptics.contact import ZERO
from devices.haptics.limits import Limits
from devices.vendor_axes import Vector3

__all__ = ["Condition", "SafetyChain"]


class Condition(Enum):
    """Why the hand gets a force, or gets none."""

    ON = "force is on"
    OFF = "not permitted: the dead-man is not held, or the device is not ready"
    WAITING = "a force is due at once: it is on when the hand has left the contact"
    SILENT = "the simulation is silent"
    TOO_FAST = "the hand was too fast: release the dead-man, then hold it again"
    INVALID = "a number is not finite"


class SafetyChain:
    """Keeps the force of a stylus within the limits.

    After every tick |F| <= limits.force, and F lies within `limits.slew` of the segment between zero and the
    force of the tick before: so |F| grows by `slew` at most, nor does a turn add more in any new direction.
    The force is zero in the same tick as a forbidding condition.
    """

    def __init__(self, limits: Limits) -> None:
        """Start with zero force."""
        self._limits = limits
        self._too_fast = False
        self.reset()

    def reset(self) -> None:
        """Set the force to zero, to rise again as at the start.

        For a lost device, and for the last frame before a stop.
        """
        self._off(Condition.OFF)

    def soften(self, size: float) -> None:
        """Let the force of a suddenly new contact rise by the ramp, unless the size (N) is small."""
        limits = self._limits
        if size > limits.calm_force:
            self._gain = min(self._gain, limits.calm_force / min(size, limits.force))

    def tick(
        self,
        wanted: Vector3,
        velocity: Vector3,
        *,
        age: float,
        permitted: bool,
        dt: float,
        ready: bool = True,
    ) -> Vector3:
        """Return the force (N) on the hand until the next tick.

        Args:
            wanted: force of the contact, N.
            velocity: of the hand, m/s.
            age: time since a contact model arrived, s; infinite if none did.
            permitted: whether the dead-man is held; only a release ends the lock after too fast a
                hand.
            dt: time since the last tick, s.
            ready: whether the device is calibrated and has no fault.
        """
        limits = self._limits
        size = hypot(*wanted)
        speed = hypot(*velocity)
        if not permitted:
            self._too_fast = False
        if not (permitted and ready):
            return self._off(Condition.OFF)
        if not isfinite(size + speed + dt):
            return self._off(Condition.INVALID)
        # the force of this tick is felt until the next one
        if not (age >= 0.0 and age + dt <= limits.silence):
            return self._off(Condition.SILENT)
        if self._too_fast or speed > limits.speed:
            self._too_fast = True
            return self._off(Condition.TOO_FAST)
        self._fade_gain(size, age, dt)
        scale = self._gain * min(1.0, limits.force / size) if size else 0.0
        self.force = _limit_slew(
            self.force, (scale * wanted[0], scale * wanted[1], scale * wanted[2]), limits.slew
        )
        return self.force

    def _fade_gain(self, size: float, age: float, dt: float) -> None:
        """Let the gain fall while the simulation is silent, and else rise once the force is engaged."""
        limits = self._limits
        if age > limits.hold:
            since = self._age if limits.hold < self._age < age else limits.hold
            self._gain *= exp((since - age) / limits.decay)
            self._calm, self.condition = 0, Condition.SILENT
        elif self._engaged:
            self._gain, self.condition = min(1.0, self._gain + max(dt, 0.0) / limits.ramp), Condition.ON
        else:
            self._calm = self._calm + 1 if size < limits.calm_force else 0
            self._engaged = self._calm >= limits.calm_ticks
            self.condition = Condition.ON if self._calm else Condition.WAITING
        self._age = age

    def _off(self, condition: Condition) -> Vector3:
        self.condition = condition
        self.force = ZERO
        self._engaged, self._gain, self._calm, self._age = False, 0.0, 0, 0.0
        return ZERO


def _limit_slew(last: Vector3, wanted: Vector3, slew: float) -> Vector3:
    """Return the force nearest to `wanted` within `slew` of the segment between zero and `last`.

    Let p be the segment's point nearest to `wanted`; the answer is p, moved towards `wanted` by at most
    `slew`: |answer| <= |p| + slew <= |last| + slew. As p and `wanted` are no longer than the norm's limit,
    nor is anything between.
    """
    lx, ly, lz = last
    wx, wy, wz = wanted
    square = lx * lx + ly * ly + lz * lz
    part = min(1.0, max(0.0, (lx * wx + ly * wy + lz * wz) / square)) if square else 0.0
    px, py, pz = part * lx, part * ly, part * lz
    dx, dy, dz = wx - px, wy - py, wz - pz
    length = hypot(dx, dy, dz)
    if length <= slew:
        return wanted
    step = slew / length
    return px + step * dx, py + step * dy, pz + step * dz
