"""Phases of a hand up to the grasp: approach the measured object, with a plan renewed on the way.

SI units, poses in the world.
"""

from __future__ import annotations

from math import cos

import numpy as np

from controllers.expert.errand import GENTLE, PATIENCE, TURNING, Errand
from controllers.expert.grasps import UPRIGHT_COSINE, Grasps
from controllers.expert.hand import HandPhase, HandRole
from controllers.expert.plans import GraspPlan, plan, plan_leaning
from robots.transform import pose_to_matrix

__all__ = ["Taking"]

_SHUT = -0.3
"""Commanded jaw angle of a grasp, rad."""
_PRESSED, _GIVEN_UP = 0.3, 0.9
"""Earliest time of a firm grip after the command to close, and time of giving up, s."""
_SAME = cos(0.05)
"""Cosine of half the largest rotation between two plans for the same grasp."""


class Taking(Errand):
    """Phases up to the grasp."""

    def _idle(self) -> None:
        index, role = self.team.choice(self)
        if index < 0:
            return
        self.state.role = role
        found = self._plan(index)
        if found is None:
            self.refusals.objects[index] = float(role is not HandRole.TAKER)
            return
        self.state.object_index = index
        self._follow(found)
        self._enter(HandPhase.RISE, self._line_raised_to(self._level))

    def _follow(self, found: GraspPlan) -> None:
        """Adopt a plan."""
        state = self.state
        state.grasp[:], state.opening, state.leans = found.grasp, found.opening, found.leans
        state.up[:] = self._seen.poses[state.object_index, :3, :3].T @ found.up
        state.upright[:], state.turns = found.upright, 0
        if found.leans:
            state.role = HandRole.ALONE

    def _rise(self) -> None:
        goal = self._approach_pose
        goal[2] = self._level
        self.hand.move_jaw(self.state.opening)
        self._enter(HandPhase.ACROSS, goal)

    def _across(self) -> None:
        if not self._is_there:
            return
        if self.state.leans:
            self._go_beside()
            return
        found = self._plan(self.state.object_index)
        if found is None or found.leans:
            self._give_up()
            return
        self._follow(found)
        self._enter(HandPhase.DESCEND, self.state.grasp, GENTLE)

    def _go_beside(self) -> None:
        """Descend beside a fallen object, if the object is still at rest."""
        if self._seen.is_free(self.state.object_index):
            self._enter(HandPhase.DESCEND, self._approach_pose, GENTLE)
        else:
            self._give_up()

    def _descend(self) -> None:
        if self.state.leans:
            if self._is_there:
                self._enter(HandPhase.REACH, self.state.grasp, GENTLE)
            return
        if (
            self.state.waited < PATIENCE
            and (found := self._plan(self.state.object_index))
            and self._goes_on(found)
        ):
            self._follow(found)
            self.state.goal[:] = self.state.grasp  # the other hand may still bring it to rest
            if not self.hand.has_settled:
                return
        self._shut_jaw()

    def _goes_on(self, found: GraspPlan) -> bool:
        """Return whether a plan continues the present grasp, up to a shift of the object."""
        same = abs(float(found.grasp[3:] @ self.state.grasp[3:])) > _SAME
        return same and not found.leans

    def _reach(self) -> None:
        if self._is_there:
            self._shut_jaw()

    def _shut_jaw(self) -> None:
        self.hand.move_jaw(_SHUT)
        self._progress.attempts += 1
        self._seen.tries[self.state.object_index] += 1.0
        self._enter(HandPhase.CLOSE)

    def _close(self) -> None:
        if self.state.waited < _PRESSED:
            return
        if self._holds and self._seen.holders[self.state.object_index]:
            if self.state.role is HandRole.TAKER:
                self._enter(HandPhase.TAKE)
            else:
                self._enter(HandPhase.LIFT, self._travel_pose())
        elif self.state.waited > _GIVEN_UP:
            self._let_go()

    def _plan(self, index: int) -> GraspPlan | None:
        """Return the best plan for an object; None: no feasible grasp."""
        other = self.team.other(self) if self.state.role is HandRole.TAKER else None
        held = None if other is None else pose_to_matrix(other.hand.measured)
        ways = self._chore.grasps(index, self._seen.poses, self.hand.jaw.length, held)
        return next((found for found in (self._best_plan(index, each) for each in ways) if found), None)

    def _best_plan(self, index: int, found: Grasps) -> GraspPlan | None:
        poses, hand = self._seen.poses, self.hand
        middle, role = poses[index, :3, 3], self.state.role
        lift = self._chore.travel - middle[2]
        if len(found.ups) and found.ups[0, 2] < UPRIGHT_COSINE:
            if role is HandRole.TAKER:
                return None
            rest = self._chore.rest(index, poses, self._chore.side(index, poses))
            return plan_leaning(hand, found, middle, lift + TURNING, rest)
        to, away = self._chore.meeting, np.zeros(2)
        if role is not HandRole.GIVER:
            to = self._chore.place(index, poses, self.team.destination(self))
        if role is not HandRole.ALONE and (other := self.team.other(self)) is not None:
            away = (hand.base - other.hand.base)[:2, 3]
            away /= np.linalg.norm(away)
        return plan(hand, found, lift, to - middle, away, self._chore.room)
