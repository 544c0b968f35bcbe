"""A surface, estimated from the force at a tip and the tip's motion.

The surface is at the beginning of the force: the depth is 0 there and grows with the motion against the
force. The stiffness is the secant push / depth, so the estimate reproduces the measured force without moving
the surface. The component across the normal is friction, within a friction cone.

Stability of a loop through the estimate for any delay: docs/decisions/0025-force-to-the-hand.md.
"""

from __future__ import annotations

from math import copysign, exp, sqrt

from hub.participant import Record, array, flag, number
from schemas.vectors import Vector

__all__ = ["ContactEstimate"]

_TOUCH = 0.05
"""Least force of a contact, N.

Below the threshold of a hand (0.06 N at a finger), and above the force of an instrument's coupling to tissue
for acceleration in free air.
"""
_CONE = 0.5
"""Slope of the friction cone of a push along the normal with friction across.

The friction of a lubricated instrument is less.
"""
_STIFFEST = 5e3
"""Largest stiffness of a secant, N/m: the first force, at no depth, has a finite stiffness."""
_MEAN = 0.02
"""Time constant of the means of force and tip, s. Both have the same lag."""
_RISE, _FALL = 0.1, 0.02
"""Time constants of stiffness and friction, s: slow for a growing force, quick for a decreasing force."""
_REACH = 0.05
"""Distance of the hand from the last touch until a surface is forgotten, m."""


class ContactEstimate(Record):
    """A surface near the tip, in the arm's base frame."""

    normal = array(3)
    """Out of the surface."""
    tip = array(3)
    """Mean position of the tip, m."""
    force = array(3)
    """Mean force on the tip, N."""
    touched = array(3)
    """Where the surface was touched last, m."""
    tip_depth = number()
    """Depth of the mean tip below the surface, m."""
    stiffness = number()
    """N/m."""
    friction = number()
    """Coulomb's coefficient."""
    known = flag()
    """Whether there is a surface."""
    started = flag()

    def depth(self, tip: Vector) -> float:
        """Return how far a tip at this position (3,), m, is below the surface, m."""
        return float(self.tip_depth + self.normal.dot(self.tip - tip))

    def update(self, tip: Vector, force: Vector, scale: float, elapsed: float) -> None:
        """Update the surface by a sample.

        Args:
            tip: position of the tip, m, shape (3,).
            force: force on the tip, N, shape (3,).
            scale: metres of the tip per metre of the hand.
            elapsed: time since the last call, s.
        """
        mean_tip, mean_force = self.tip, self.force
        if not self.started:
            mean_tip[:], self.started = tip, True
        share = 1.0 - exp(-elapsed / _MEAN)
        move = share * (tip - mean_tip)
        mean_tip += move
        mean_force += share * (force - mean_force)
        known = self.known
        if known:
            self._follow(move)
        size = _length(mean_force)
        if size < _TOUCH:
            self.tip_depth = min(self.tip_depth, 0.0)
            if known and _length(mean_tip - self.touched) > _REACH * scale:
                self.known, self.stiffness, self.friction = False, 0.0, 0.0
            return
        self._turn(mean_force / size)
        self.touched[:], self.known = mean_tip, True
        push = float(self.normal.dot(self.force))
        depth = self.tip_depth = max(self.tip_depth, push / _STIFFEST)
        across = _length(self.force - push * self.normal)
        self.stiffness += _approach_step(self.stiffness, push / depth, elapsed)
        self.friction += _approach_step(self.friction, across / push, elapsed)

    def _follow(self, move: Vector) -> None:
        """Add the tip's motion `move` (3,) to the depth.

        Corrected for the apparent motion of sliding along a normal tilted by friction.
        """
        along = float(self.normal.dot(move))
        across = _length(move - along * self.normal)
        self.tip_depth -= copysign(max(0.0, abs(along) - _CONE * across), along)

    def _turn(self, direction: Vector) -> None:
        """Turn the normal just enough to have `direction` (3,) in the friction cone; keep the depth."""
        along = float(self.normal.dot(direction))
        aside = self.normal - along * direction
        size = _length(aside)
        if not self.known or not size:
            self.normal[:] = direction
        elif size > _CONE * along:
            turned = direction + _CONE / size * aside
            self.normal[:] = turned / _length(turned)


def _length(vector: Vector) -> float:
    return sqrt(vector.dot(vector))  # np.linalg.norm's own way, at a fifth of its cost


def _approach_step(value: float, target: float, elapsed: float) -> float:
    """Return by how much `value` goes towards `target` in `elapsed` seconds."""
    time = _RISE if target > value else _FALL
    return (1.0 - exp(-elapsed / time)) * (target - value)
