"""A surface, estimated from the force at a tip and the tip's motion.

The surface lies where the force began: the depth is 0 there and grows with the motion against the force. Its
stiffness is the secant push / depth, so that the estimate gives back the measured force without moving the
surface. What lies across the normal is friction, as long as it fits into a friction cone.

Why a loop through it is stable, whatever the delay, stands in docs/decisions/0025-force-to-the-hand.md.
"""

from __future__ import annotations

from math import copysign, exp

import numpy as np

from schemas.vectors import Vector

__all__ = ["ContactEstimate"]

_TOUCH = 0.05
"""N; less is no contact: below what a hand feels (0.06 N at a finger), above what an instrument's coupling to
tissue needs to speed it up in free air.
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
"""s; time constants of stiffness and friction: slow where the hand gets more force, quick where it gets less.
"""
_REACH = 0.05
"""m of the hand; a surface is forgotten this far from where it was last touched."""


class ContactEstimate:
    """One surface near the tip, in the arm's base frame. Its numbers live in a part of its owner's state."""

    SIZE = 17

    def __init__(self, state: Vector) -> None:
        """Remember in `state`, shape (SIZE,); zeros know of nothing."""
        parts = np.split(state, [3, 6, 9, 12, 13, 14, 15, 16])
        (
            self._normal,
            self._tip,
            self._force,
            self._touched,
            self._depth,
            self._stiffness,
            self._friction,
            self._known,
            self._started,
        ) = parts

    @property
    def known(self) -> bool:
        """Whether there is a surface."""
        return bool(self._known[0])

    @property
    def normal(self) -> Vector:
        """Out of the surface, shape (3,)."""
        return self._normal

    @property
    def stiffness(self) -> float:
        """N/m."""
        return float(self._stiffness[0])

    @property
    def friction(self) -> float:
        """Coulomb's coefficient."""
        return float(self._friction[0])

    def depth(self, tip: Vector) -> float:
        """Return how far a tip at this position (3,), m, is below the surface, m."""
        return float(self._depth[0] + self._normal @ (self._tip - tip))

    def update(self, tip: Vector, force: Vector, scale: float, elapsed: float) -> None:
        """Take the position (3,) of the tip, m, the force (3,) on it, N, the metres of the tip per metre of
        the hand, and the time since the last call, s.
        """
        if not self._started[0]:
            self._tip[:], self._started[0] = tip, 1.0
        share = 1.0 - exp(-elapsed / _MEAN)
        move = share * (tip - self._tip)
        self._tip += move
        self._force += share * (force - self._force)
        if self.known:
            self._follow(move)
        size = float(np.linalg.norm(self._force))
        if size < _TOUCH:
            self._depth[0] = min(self._depth[0], 0.0)
            if np.linalg.norm(self._tip - self._touched) > _REACH * scale:
                self._known[0] = self._stiffness[0] = self._friction[0] = 0.0
            return
        self._turn(self._force / size)
        self._touched[:], self._known[0] = self._tip, 1.0
        push = float(self._normal @ self._force)
        depth = self._depth[0] = max(self._depth[0], push / _STIFFEST)
        across = float(np.linalg.norm(self._force - push * self._normal))
        _approach(self._stiffness, push / depth, elapsed)
        _approach(self._friction, across / push, elapsed)

    def _follow(self, move: Vector) -> None:
        """Take the tip's motion `move` (3,) into the depth, less what sliding may seem to add where friction
        has tilted the normal.
        """
        along = float(self._normal @ move)
        across = float(np.linalg.norm(move - along * self._normal))
        self._depth[0] -= copysign(max(0.0, abs(along) - _CONE * across), along)

    def _turn(self, direction: Vector) -> None:
        """Turn the normal as little as brings `direction` (3,) into the friction cone about it; the depth
        stays.
        """
        along = float(self._normal @ direction)
        aside = self._normal - along * direction
        size = float(np.linalg.norm(aside))
        if not self.known or not size:
            self._normal[:] = direction
        elif size > _CONE * along:
            turned = direction + _CONE / size * aside
            self._normal[:] = turned / np.linalg.norm(turned)


def _approach(value: Vector, target: float, elapsed: float) -> None:
    time = _RISE if target > value[0] else _FALL
    value[0] += (1.0 - exp(-elapsed / time)) * (target - value[0])
