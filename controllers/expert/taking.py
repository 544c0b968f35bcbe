"""How a hand takes hold of a thing: where it is seen, by a plan that is made anew on the way.

SI units, poses in the world.
"""

from __future__ import annotations

from math import cos

import numpy as np

from controllers.expert.errand import GENTLE, PATIENCE, TURNING, Errand
from controllers.expert.grasps import UPRIGHT, Grasps
from controllers.expert.hand import Phase, Role, framed
from controllers.expert.plans import Plan, plan, plan_leaning

__all__ = ["Taking"]

_SHUT = -0.3
"""rad: the command to a jaw that grasps."""
_PRESSED, _GIVEN_UP = 0.3, 0.9
"""s: until a jaw holds at the earliest; until it does not."""
_SAME = cos(0.05)
"""Of half the turn between two plans for the same grasp."""


class Taking(Errand):
    """Until the thing is held."""

    def _idle(self) -> None:
        thing, role = self.team.choice(self)
        if thing < 0:
            return
        self.state.role = role
        found = self._plan(thing)
        if found is None:
            self.refusals.things[thing] = float(role is not Role.TAKER)
            return
        self.state.thing = thing
        self._follow(found)
        self._enter(Phase.RISE, self._raised(self._level))

    def _follow(self, found: Plan) -> None:
        """Take a plan for that of this hand."""
        state = self.state
        state.grasp[:], state.opening, state.leans = found.grasp, found.opening, found.leans
        state.up[:] = self._seen.poses[state.thing, :3, :3].T @ found.up
        state.upright[:], state.turns = found.upright, 0
        if found.leans:
            state.role = Role.ALONE

    def _rise(self) -> None:
        goal = self._before
        goal[2] = self._level
        self.hand.move_jaw(self.state.opening)
        self._enter(Phase.ACROSS, goal)

    def _across(self) -> None:
        if not self._is_there:
            return
        if self.state.leans:
            self._go_beside()
            return
        found = self._plan(self.state.thing)
        if found is None or found.leans:
            self._give_up()
            return
        self._follow(found)
        self._enter(Phase.DESCEND, self.state.grasp, GENTLE)

    def _go_beside(self) -> None:
        """Go down beside a fallen thing, if it still lies there."""
        if self._seen.is_free(self.state.thing):
            self._enter(Phase.DESCEND, self._before, GENTLE)
        else:
            self._give_up()

    def _descend(self) -> None:
        if self.state.leans:
            if self._is_there:
                self._enter(Phase.REACH, self.state.grasp, GENTLE)
            return
        if self.state.waited < PATIENCE and (found := self._plan(self.state.thing)) and self._goes_on(found):
            self._follow(found)
            self.state.goal[:] = self.state.grasp  # the other hand may still bring it to rest
            if not self.hand.has_settled:
                return
        self._shut()

    def _goes_on(self, found: Plan) -> bool:
        """Say whether a plan is that of this hand, but for what the thing has moved: fingers are in it."""
        same = abs(float(found.grasp[3:] @ self.state.grasp[3:])) > _SAME
        return same and not found.leans

    def _reach(self) -> None:
        if self._is_there:
            self._shut()

    def _shut(self) -> None:
        self.hand.move_jaw(_SHUT)
        self._progress.attempts += 1
        self._seen.tries[self.state.thing] += 1.0
        self._enter(Phase.CLOSE)

    def _close(self) -> None:
        if self.state.waited < _PRESSED:
            return
        if self._holds and self._seen.holders[self.state.thing]:
            if self.state.role is Role.TAKER:
                self._enter(Phase.TAKE)
            else:
                self._enter(Phase.LIFT, self._lifted())
        elif self.state.waited > _GIVEN_UP:
            self._let_go()

    def _plan(self, thing: int) -> Plan | None:
        """Return how to take hold of a thing; None: it cannot be taken."""
        other = self.team.other(self) if self.state.role is Role.TAKER else None
        held = None if other is None else framed(other.hand.measured)
        ways = self._chore.grasps(thing, self._seen.poses, self.hand.jaw.length, held)
        return next((found for found in (self._best(thing, each) for each in ways) if found), None)

    def _best(self, thing: int, found: Grasps) -> Plan | None:
        poses, hand = self._seen.poses, self.hand
        middle, role = poses[thing, :3, 3], self.state.role
        lift = self._chore.travel - middle[2]
        if len(found.ups) and found.ups[0, 2] < UPRIGHT:
            if role is Role.TAKER:
                return None
            rest = self._chore.rest(thing, poses, self._chore.side(thing, poses))
            return plan_leaning(hand, found, middle, lift + TURNING, rest)
        to, away = self._chore.meeting, np.zeros(2)
        if role is not Role.GIVER:
            to = self._chore.place(thing, poses, self.team.destination(self))
        if role is not Role.ALONE and (other := self.team.other(self)) is not None:
            away = (hand.base - other.hand.base)[:2, 3]
            away /= np.linalg.norm(away)
        return plan(hand, found, lift, to - middle, away, self._chore.room)
