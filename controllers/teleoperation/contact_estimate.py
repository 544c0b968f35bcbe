"""A surface, estimated from the force at a tip and the tip's motion.

The surface lies where the force began: the depth is 0 there and grows with the motion against the force. Its stiffness is the secant
F / depth, so that the estimate gives back the measured force. The secant follows a rise of F / depth slowly and a fall at
once: a model of this estimate never claims more than was measured.

Why a loop through it is stable, whatever the delay, stands in docs/decisions/0025-force-to-the-hand.md.
"""

from __future__ import annotations

from math import copysign, exp

import numpy as np

from schemas.vectors import Vector

__all__ = ["ContactEstimate"]

_TOUCH = 0.03
"""N; less is no contact."""
_STIFFEST = 5e3
"""N/m; no secant is taken for stiffer, so that a force without any depth has a finite one."""
_RISE = 0.1
"""s; time constant with which the stiffness rises and the normal turns."""
_SLIDE = 0.5
"""Motion that leaves the tangent plane by less than this slope slides: Coulomb friction of up to this coefficient tilts the force by as much."""
_REACH = 0.05
"""m of the hand; a surface is forgotten this far from where it was last touched."""


class ContactEstimate:
    """One surface near the tip, in the arm's base frame. Its numbers live in a part of its owner's state."""

    SIZE = 12

    def __init__(self, state: Vector) -> None:
        """Remember in `state`, shape (SIZE,); zeros know of no surface."""
        self._normal, self._tip, self._touched, self._depth, self._stiffness, self._known = np.split(state, [3, 6, 9, 10, 11])

    @property
    def known(self) -> bool:
        """Whether there is a surface."""
        return bool(self._known[0])

    @property
    def normal(self) -> Vector:
        """Out of the surface, shape (3,)."""
        return self._normal

    @property
    def depth(self) -> float:
        """How far the tip is below the surface, m."""
        return float(self._depth[0])

    @property
    def stiffness(self) -> float:
        """N/m."""
        return float(self._stiffness[0])

    def update(self, tip: Vector, force: Vector, scale: float, elapsed: float) -> None:
        """Take the position (3,) of the tip, m, the force (3,) on it, N, the metres of the tip per metre of the hand, and the time since the last call, s."""
        magnitude = float(np.linalg.norm(force))
        if self.known:
            self._follow(tip - self._tip)
        self._tip[:] = tip
        if magnitude < _TOUCH:
            self._depth[0] = min(self._depth[0], 0.0)
            if np.linalg.norm(tip - self._touched) > _REACH * scale:
                self._known[0] = self._stiffness[0] = 0.0
            return
        share = 1.0 - exp(-elapsed / _RISE)
        self._turn(force / magnitude, share if self.known else 1.0)
        self._touched[:], self._known[0] = tip, 1.0
        depth = self._depth[0] = max(self._depth[0], magnitude / _STIFFEST)
        secant, stiffness = magnitude / depth, self._stiffness[0]
        self._stiffness[0] = min(secant, stiffness + share * (secant - stiffness))

    def _follow(self, move: Vector) -> None:
        """Take the tip's motion `move` (3,) into the depth, as far as it does not slide along the surface."""
        along = float(self._normal @ move)
        across = float(np.linalg.norm(move - along * self._normal))
        self._depth[0] -= copysign(max(0.0, abs(along) - _SLIDE * across), along)

    def _turn(self, direction: Vector, share: float) -> None:
        """Turn the normal by `share` of the way to `direction`; the depth stays."""
        normal = self._normal + share * (direction - self._normal)
        length = float(np.linalg.norm(normal))
        self._normal[:] = normal / length if length > 0.0 else direction
