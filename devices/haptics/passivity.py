"""A passivity observer and controller: what is rendered may not give the hand more energy than the hand gave
it.

After Hannaford and Ryu, Time-domain passivity control of haptic interfaces, IEEE Transactions on Robotics and
Automation 18(1), 2002. Between two ticks a device holds its force, so the work is exactly force times way.
The book is closed whenever the hand is given no force: what was dissipated in one contact does not pay for
the next.
"""

from __future__ import annotations

from devices.haptics.contact import ZERO
from devices.vendor_axes import Vector3

__all__ = ["Passivity"]


class Passivity:
    """Books the energy that the hand has put into the contact, and damps as soon as more would come back."""

    def __init__(self, damping: float) -> None:
        """Take the largest damping (N s/m) with which it may brake."""
        self._damping = damping
        self.reset()

    def reset(self) -> None:
        """Close the book."""
        self.energy = 0.0
        """What the hand has put in and not got back, J."""
        self._given: Vector3 = ZERO
        self._position: Vector3 = ZERO

    def correct(self, wanted: Vector3, position: Vector3, velocity: Vector3, dt: float) -> Vector3:
        """Return `wanted` (N), braked if the hand at `position` (m) with `velocity` (m/s) would get more
        energy within the next `dt` s than is in the book.
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

    def gave(self, force: Vector3) -> None:
        """Take note of the force (N) that the hand is given until the next tick."""
        self._given = force
