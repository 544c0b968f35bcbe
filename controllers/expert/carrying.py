"""Phases of a hand with an object: lift, put upright, hand over, align, lower, release.

SI units, poses in the world.
"""

from __future__ import annotations

from math import acos, hypot

import numpy as np

from controllers.expert.errand import GENTLE, PATIENCE, Errand
from controllers.expert.grasps import RING_OPENING
from controllers.expert.hand import HandPhase, HandRole
from controllers.expert.plans import upright
from robots import rotation
from schemas.vectors import Vector

__all__ = ["Carrying"]

_IN_LINE = 0.5e-3
"""Largest horizontal error of an aligned object, m."""
_ALIGNING = 0.08
"""Time constant of the alignment of an object, s."""
_OPENED = 0.25
"""Time of a jaw to release, s."""
_WIDEST = 0.8
"""Largest jaw opening, in steps of `RING_OPENING`, while the released object clings to the fingers, rad."""
_OFFERED = 20.0
"""Longest wait for the second hand in a hand-over, s; the second hand may first put an object down."""
_STRAIGHT, _TURNS = 0.05, 3
"""Largest tilt of an upright object, rad, and largest number of turns to put an object upright."""
_LEAVING = {HandPhase.OFFER, HandPhase.OPEN, HandPhase.RETREAT}


class Carrying(Errand):
    """Phases from the grasp to the retreat."""

    def _lift(self) -> None:
        if self._has_lost():
            return
        if self.state.leans:
            goal = self.hand.line()
            goal[3:] = self.state.upright
            self._enter(HandPhase.TURN, goal)
            return
        self._carry_to(self._chore.meeting if self.state.role is HandRole.GIVER else self._place())

    def _turn(self) -> None:
        """Turn until the measured object is upright, then carry the object to a place to stand."""
        if self._has_lost():
            return
        self.state.turns += 1
        if acos(min(1.0, self._upright_axis[2])) > _STRAIGHT and self.state.turns <= _TURNS:
            goal = self.hand.line()
            goal[3:] = rotation.product(rotation.from_matrix(upright(self._upright_axis)), goal[3:])
            self._enter(HandPhase.TURN, goal)
            return
        self._put_aside()

    def _put_aside(self) -> None:
        """Carry the object to a free place on its own side."""
        poses, index = self._seen.poses, self.state.object_index
        self.state.role = HandRole.ALONE
        self.state.place[:] = self._chore.rest(index, poses, self._chore.side(index, poses))
        self._carry_to(self.state.place)

    def _carry_to(self, to: Vector) -> None:
        self._enter(HandPhase.CARRY, self._line_moved_by(np.append((to - self._middle)[:2], 0.0)))

    def _place(self) -> Vector:
        self.state.place[:] = self._chore.place(
            self.state.object_index, self._seen.poses, self.team.destination(self)
        )
        return self.state.place

    def _carry(self) -> None:
        if self._has_lost():
            return
        if self.state.role is HandRole.GIVER:
            self._enter(HandPhase.OFFER)
            return
        down = self._chore.above(self.state.place) - self._middle[2]
        self._enter(HandPhase.ALIGN, self._line_moved_by(np.array([0.0, 0.0, down])))

    def _align(self) -> None:
        if self._has_lost():
            return
        off = self.state.place - self._middle
        if hypot(off[0], off[1]) > _IN_LINE and self.state.waited < 2.0 * PATIENCE:
            self.state.goal[:2] += off[:2] * (self.hand.period / _ALIGNING)
            return
        self._enter(HandPhase.LOWER, self._line_moved_by(np.array([0.0, 0.0, off[2]])), GENTLE)

    def _lower(self) -> None:
        self._let_go()

    def _open(self) -> None:
        if self.state.waited <= _OPENED:
            return
        if self._clings and self.state.opening + RING_OPENING <= _WIDEST:
            self.state.opening += RING_OPENING
            self._let_go()
        else:
            self._enter(HandPhase.RETREAT, self._line_moved_by(self._back), GENTLE)

    def _retreat(self) -> None:
        """Leave the released object; if the object clings, lower again and open further."""
        if self._clings and self.state.opening + RING_OPENING <= _WIDEST:
            self.state.opening += RING_OPENING
            self._enter(HandPhase.LOWER, self._line_moved_by(-self._back), GENTLE)
        else:
            self._give_up()

    def _offer(self) -> None:
        if self._has_lost():
            return
        other = self.team.other(self)
        if other is not None and other.state.phase is HandPhase.TAKE:
            self._let_go()
        elif self.state.waited > _OFFERED:
            self._put_aside()

    def _take_object(self) -> None:
        other = self.team.other(self)
        if other is not None and other.state.phase in _LEAVING:
            return
        if not self._has_lost():
            self._enter(HandPhase.LIFT, self._travel_pose())
