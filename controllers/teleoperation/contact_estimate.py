"""A surface, estimated from the force at a tip and the tip's motion.

The surface lies where the force began: the depth is 0 there and grows with the motion against the force. Its
stiffness is the secant push / depth, so that the estimate gives back the measured force without moving the
surface. What lies across the normal is friction, as long as it fits into a friction cone.

Why a loop through it is stable, whatever the delay, stands in docs/decisions/0025-force-to-the-hand.md.
"""

from __future__ import annotations

from math import copysign, exp, sqrt

from hub.participant import Record, array, flag, number
from schemas.vectors import Vector

__all__ = ["ContactEstimate"]

_TOUCH = 0.05
"""N; less is no contact.

It is below what a hand feels (0.06 N at a finger), and above what an instrument's coupling to tissue needs to
accelerate it in free air.
"""
_CONE = 0.5
"""Slope of the friction cone: a force in it may be a push along the normal with friction across.

A lubricated instrument rubs with less.
"""
_STIFFEST = 5e3
"""N/m; no secant is taken for stiffer, so that the first force, at no depth, has a finite one."""
_MEAN = 0.02
"""s; time constant of the means of force and tip. As both lag alike, they belong to each other."""
_RISE, _FALL = 0.1, 0.02
"""s; time constants of stiffness and friction: slow where the force grows, quick where it decreases."""
_REACH = 0.05
"""m of the hand; a surface is forgotten this far from where it was last touched."""


class ContactEstimate(Record):
    """One surface near the tip, in the arm's base frame."""

    normal = array(3)
    """Out of the surface."""
    tip = array(3)
    """Mean position of the tip, m."""
    force = array(3)
    """Mean force on the tip, N."""
    touched = array(3)
    """Where the surface was touched last, m."""
    tip_depth = number()
    """Of the mean tip below the surface, m."""
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
        """Update the surface by one sample.

        Args:
            tip: position of the tip, m, shape (3,).
            force: on the tip, N, shape (3,).
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
        self.stiffness += _approach(self.stiffness, push / depth, elapsed)
        self.friction += _approach(self.friction, across / push, elapsed)

    def _follow(self, move: Vector) -> None:
        """Add the tip's motion `move` (3,) to the depth.

        Less what sliding may seem to add where friction has tilted the normal.
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


def _approach(value: float, target: float, elapsed: float) -> float:
    """Return by how much `value` goes towards `target` in `elapsed` seconds."""
    time = _RISE if target > value else _FALL
    return (1.0 - exp(-elapsed / time)) * (target - value)
