"""The haptic loop of a stylus: at every tick of the device a safe force from the newest contact model.

Plain floats and a single clock, to fit into a servo callback: no numpy, no pydantic, no lock.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf

from devices.haptics.contact import Plane, check_planes
from devices.haptics.limits import Limits
from devices.haptics.passivity import Passivity
from devices.haptics.rendering import Renderer
from devices.haptics.safety import Condition, SafetyChain
from devices.vendor_axes import Vector3

__all__ = ["HapticLoop"]

_READ_BEFORE = 0.01
"""Largest lead of a model's arrival over the tick's time, s: another thread receives models, possibly after
the time was read. A time farther in the future is wrong.
"""


class HapticLoop:
    """Renders the newest contact model and passes the force through the safety chain.

    All vectors in the device's base frame.
    """

    def __init__(self, limits: Limits, *, passivity: bool = False) -> None:
        """Start without contact and force; `passivity` adds the controller of `devices.haptics.passivity`."""
        self._limits = limits
        self._renderer = Renderer(limits.stiffness, limits.damping)
        self._chain = SafetyChain(limits)
        self._passivity = Passivity(limits.damping) if passivity else None
        self._planes: tuple[Plane, ...] = ()
        self._appeared = False
        self._stamp_ns = 0
        self._arrived = -inf
        self._now = -inf

    @property
    def force(self) -> Vector3:
        """The force (N) of the last tick."""
        return self._chain.force

    @property
    def condition(self) -> Condition:
        """Reason for the last force on or off."""
        return self._chain.condition

    def receive(self, planes: Sequence[Plane], stamp_ns: int, arrived: float) -> bool:
        """Use a contact model from the next tick on; return False if ignored.

        Ignored are invalid planes, and a stamp not newer than the newest. After a silence down to zero
        force every stamp is accepted, because another session starts at 0 again.

        Args:
            planes: planes of the model, base frame.
            stamp_ns: stamp of the model, ns.
            arrived: time of arrival, s of the clock of `tick`.
        """
        if stamp_ns <= self._stamp_ns and arrived - self._arrived <= self._limits.silence:
            return False
        valid = check_planes(planes)
        if valid is None or not abs(arrived) < inf:
            return False
        self._appeared = bool(valid) and (self._appeared or not self._planes)
        self._planes, self._stamp_ns, self._arrived = valid, stamp_ns, arrived
        return True

    def tick(
        self, now: float, position: Vector3, velocity: Vector3, *, permitted: bool, ready: bool = True
    ) -> Vector3:
        """Return the force (N) on the hand from this tick to the next.

        Args:
            now: time of the tick, s of a monotonic clock.
            position: of the hand, m.
            velocity: of the hand, m/s.
            permitted: whether the dead-man is held.
            ready: whether the device is calibrated and has no fault.
        """
        dt = now - self._now if self._now > -inf else 0.0
        self._now = now
        age = now - self._arrived
        if -_READ_BEFORE < age < 0.0:
            age = 0.0
        wanted = self._renderer.force(self._planes, age, position, velocity)
        if self._appeared:  # perhaps at a hand that has taken an instrument which presses already
            self._appeared = False
            self._chain.soften(hypot(*wanted))
        if self._passivity is not None:
            wanted = self._passivity.correct(wanted, position, velocity, dt)
        given = self._chain.tick(wanted, velocity, age=age, permitted=permitted, dt=dt, ready=ready)
        if self._passivity is not None:
            self._passivity.remember_force(given)
        if self._chain.condition is Condition.INVALID:
            self._renderer.reset()
        return given

    def reset(self) -> None:
        """Set the force to zero, as in a device's last frame, and discard the contact model."""
        self._chain.reset()
        self._renderer.reset()
        if self._passivity is not None:
            self._passivity.reset()
        self._planes, self._appeared, self._stamp_ns, self._arrived, self._now = (), False, 0, -inf, -inf
