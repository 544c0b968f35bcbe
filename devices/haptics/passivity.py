"""A passivity observer and controller: the hand gets back no more energy than put in.

After Hannaford and Ryu, Time-domain passivity control of haptic interfaces, IEEE Transactions on Robotics
and Automation 18(1), 2002. Between two ticks a device holds the force, so the work is exactly force times
displacement. The sum starts at zero whenever the hand gets no force: energy dissipated in a contact does
not allow more in the next.
"""

from __future__ import annotations

from devices.haptics.contact import ZERO
from devices.vendor_axes import Vector3

__all__ = ["Passivity"]


class Passivity:
    """Sums the energy put into the contact by the hand, and damps as soon as more would come back."""

    def __init__(self, damping: float) -> None:
        """`damping`: largest added damping, N s/m."""
        self._damping = damping
        self.reset()

    def reset(self) -> None:
        """Start at zero."""
        self.energy = 0.0
        """Energy put in by the hand and not got back, J."""
        self._given: Vector3 = ZERO
        self._position: Vector3 = ZERO

    def correct(self, wanted: Vector3, position: Vector3, velocity: Vector3, dt: float) -> Vector3:
        """Return the force `wanted` (N), damped if the hand would get more energy than put in.

        Args:
            wanted: force of the contact, N.
            position: of the hand, m.
            velocity: of the hand, m/s.
            dt: time from this tick to the next, s.
        """
        (gx, gy, gz), (x, y, z), (px, py, pz) = self._given, position, self._position
        work = gx * (x - px) + gy * (y - py) + gz * (z - pz)
        self.energy = self.energy - work if self._given != ZERO else 0.0
        self._position = position
        (fx, fy, fz), (vx, vy, vz) = wanted, velocity
        square = vx * vx + vy * vy + vz * vz
        left = self.energy - (fx * vx + fy * vy + fz * vz) * dt
        if left >= 0.0 or square * dt <= 0.0:
            return wanted
        damping = min(-left / (square * dt), self._damping)
        return fx - damping * vx, fy - damping * vy, fz - damping * vz

    def remember_force(self, force: Vector3) -> None:
        """Remember the force (N) on the hand until the next tick."""
        self._given = force
