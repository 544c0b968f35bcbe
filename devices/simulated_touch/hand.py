"""A hand at a stylus: a mass on a spring and a damper, in the base frame."""

from __future__ import annotations

from math import cos, cosh, exp, sin, sinh, sqrt

from devices.haptics.contact import ZERO
from devices.vendor_axes import Vector3

__all__ = ["SimulatedHand"]


class SimulatedHand:
    """A hand moved by the exact solution of a differential equation, with force and target held for a tick.

    The exact motion matters: a force held during the hand's motion makes sampled walls active, and a step of
    semi-implicit Euler would hide just this effect.
    """

    def __init__(self, mass: float, stiffness: float, damping: float, tick: float, position: Vector3) -> None:
        """Start at rest at `position` (m). Mass (kg), grip (N/m, N s/m), and the time (s) of a `move`."""
        self.position, self.velocity = position, ZERO
        self._stiffness, self._damping = stiffness, damping
        # m e'' + c e' + k e = 0 from e, v over one tick: e^(-a t) [[C + a S, S], [-(k/m) S, C - a S]], a =
        # c/2m, w^2 = k/m - a^2, C = cos w t, S = sin(w t)/w
        a = damping / (2.0 * mass)
        square = stiffness / mass - a * a
        w = sqrt(abs(square))
        c, s = (
            (cos(w * tick), sin(w * tick) / w)
            if square > 0.0
            else (cosh(w * tick), sinh(w * tick) / w)
            if square < 0.0
            else (1.0, tick)
        )
        e = exp(-a * tick)
        self._step = e * (c + a * s), e * s, -e * s * stiffness / mass, e * (c - a * s)

    def move(self, force: Vector3, target: Vector3, velocity: Vector3) -> None:
        """Move for a tick under `force` (N), with spring and damper to `target` (m) and `velocity` (m/s)."""
        axis = self._axis_step
        (x, y, z), (vx, vy, vz), (fx, fy, fz) = self.position, self.velocity, force
        (tx, ty, tz), (ux, uy, uz) = target, velocity
        (x, vx), (y, vy), (z, vz) = axis(x, vx, fx, tx, ux), axis(y, vy, fy, ty, uy), axis(z, vz, fz, tz, uz)
        self.position, self.velocity = (x, y, z), (vx, vy, vz)

    def _axis_step(
        self, x: float, v: float, force: float, target: float, velocity: float
    ) -> tuple[float, float]:
        xx, xv, vx, vv = self._step
        rest = target + (force + self._damping * velocity) / self._stiffness
        e = x - rest
        return rest + xx * e + xv * v, vx * e + vv * v
