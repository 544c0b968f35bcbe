"""What a hand does with the thing that it holds: lift, put upright, give, put down by its own pose, let go.

SI units, poses in the world.
"""

from __future__ import annotations

from math import acos, hypot

import numpy as np

from controllers.expert.errand import GENTLE, PATIENCE, Errand
from controllers.expert.grasps import AJAR
from controllers.expert.hand import Phase, Role
from controllers.expert.plans import upright
from robots import rotation
from schemas.vectors import Vector

__all__ = ["Carrying"]

_IN_LINE = 0.5e-3
"""m: of a thing over its place."""
_ALIGNING = 0.08
"""Time constant with which a thing is brought in line, s."""
_OPENED = 0.25
"""s: for a jaw to let go."""
_WIDEST = 0.8
"""rad: so far a jaw opens, a step of `AJAR` at a time, while what it let go of clings to its fingers."""
_OFFERED = 20.0
"""s: for the other hand to take what is offered; it may have to put something down before."""
_STRAIGHT, _TURNS = 0.05, 3
"""rad: of a thing that is upright; how often a hand turns to bring it there."""
_LEAVING = {Phase.OFFER, Phase.OPEN, Phase.RETREAT}


class Carrying(Errand):
    """From the grasp until the hand has left the thing."""

    def _lift(self) -> None:
        if self._lost():
            return
        if self.state.leans:
            goal = self.hand.line()
            goal[3:] = self.state.upright
            self._enter(Phase.TURN, goal)
            return
        self._bring(self._chore.meeting if self.state.role is Role.GIVER else self._place())

    def _turn(self) -> None:
        """Turn on until the thing is upright by its own pose, then bring it where it can stand."""
        if self._lost():
            return
        self.state.turns += 1
        if acos(min(1.0, self._up[2])) > _STRAIGHT and self.state.turns <= _TURNS:
            goal = self.hand.line()
            goal[3:] = rotation.product(rotation.from_matrix(upright(self._up)), goal[3:])
            self._enter(Phase.TURN, goal)
            return
        self._put_aside()

    def _put_aside(self) -> None:
        """Bring the thing where it can stand by itself, on the side where it is."""
        poses, thing = self._seen.poses, self.state.thing
        self.state.role = Role.ALONE
        self.state.place[:] = self._chore.rest(thing, poses, self._chore.side(thing, poses))
        self._bring(self.state.place)

    def _bring(self, to: Vector) -> None:
        self._enter(Phase.CARRY, self._moved(np.append((to - self._middle)[:2], 0.0)))

    def _place(self) -> Vector:
        self.state.place[:] = self._chore.place(
            self.state.thing, self._seen.poses, self.team.destination(self)
        )
        return self.state.place

    def _carry(self) -> None:
        if self._lost():
            return
        if self.state.role is Role.GIVER:
            self._enter(Phase.OFFER)
            return
        down = self._chore.above(self.state.place) - self._middle[2]
        self._enter(Phase.ALIGN, self._moved(np.array([0.0, 0.0, down])))

    def _align(self) -> None:
        if self._lost():
            return
        off = self.state.place - self._middle
        if hypot(off[0], off[1]) > _IN_LINE and self.state.waited < 2.0 * PATIENCE:
            self.state.goal[:2] += off[:2] * (self.hand.period / _ALIGNING)
            return
        self._enter(Phase.LOWER, self._moved(np.array([0.0, 0.0, off[2]])), GENTLE)

    def _lower(self) -> None:
        self._let_go()

    def _open(self) -> None:
        if self.state.waited <= _OPENED:
            return
        if self._clings and self.state.opening + AJAR <= _WIDEST:
            self.state.opening += AJAR
            self._let_go()
        else:
            self._enter(Phase.RETREAT, self._moved(self._back), GENTLE)

    def _retreat(self) -> None:
        """Leave what was let go of; if it has come along, put it down again, and open further."""
        if self._clings and self.state.opening + AJAR <= _WIDEST:
            self.state.opening += AJAR
            self._enter(Phase.LOWER, self._moved(-self._back), GENTLE)
        else:
            self._give_up()

    def _offer(self) -> None:
        if self._lost():
            return
        other = self.team.other(self)
        if other is not None and other.state.phase is Phase.TAKE:
            self._let_go()
        elif self.state.waited > _OFFERED:
            self._put_aside()

    def _take(self) -> None:
        other = self.team.other(self)
        if other is not None and other.state.phase in _LEAVING:
            return
        if not self._lost():
            self._enter(Phase.LIFT, self._lifted())
