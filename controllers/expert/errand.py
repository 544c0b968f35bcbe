"""The task of one hand with one object: poses, grip, and the moves common to all phases.

SI units, poses in the world.
"""

from __future__ import annotations

import numpy as np

from controllers.expert.fallen_rings import BESIDE
from controllers.expert.hand import HandPhase, RobotHand
from controllers.expert.team import Refusals, Team
from robots import rotation
from schemas.vectors import Vector

__all__ = ["GENTLE", "PATIENCE", "TURNING", "Errand"]

PATIENCE = 0.6
"""Longest wait for a tip or an object to reach its target, s; then the next phase begins all the same."""
GENTLE = 0.4
"""Fraction of the speed for the descent to an object."""
TURNING = 0.015
"""Extra height for putting an object upright, m: the object swings about the tip."""
_HOVER = 0.020
"""Height of the tip over the grasp before the descent and after the release, m."""
_HELD_OPEN = 0.03
"""A jaw commanded to shut and open by more than this angle holds an object, rad."""
_UNHELD = 0.25
"""Time without a holder until an object counts as lost, s."""
_AS_WIDE = 0.9
"""Fraction of the grasp's opening above which a released jaw counts as open."""


class Errand:
    """A hand's current transfer task."""

    def __init__(self, hand: RobotHand, team: Team, objects: int) -> None:
        """`objects`: number of objects of the scene."""
        self.hand, self.team, self.state = hand, team, hand.state
        self._chore, self._seen, self._progress = team.chore, team.seen, team.progress
        self.refusals = Refusals(n=objects)

    def _enter(self, phase: HandPhase, goal: Vector | None = None, share: float = 1.0) -> None:
        """Begin `phase` with a line to `goal`, by default to the commanded pose."""
        self.state.phase, self.state.waited = phase, 0.0
        self.hand.go(self.hand.line() if goal is None else goal, share)

    def _line_raised_to(self, height: float) -> Vector:
        """Return the pose of the tip's line, not below `height`."""
        goal = self.hand.line()
        goal[2] = max(goal[2], height)
        return goal

    def _line_moved_by(self, by: Vector) -> Vector:
        goal = self.hand.line()
        goal[:3] += by
        return goal

    def _travel_pose(self) -> Vector:
        """Return the pose of the tip with the object's middle at travel height."""
        height = self._chore.travel + (TURNING if self.state.leans else 0.0)
        return self._line_moved_by(np.array([0.0, 0.0, height - self._middle[2]]))

    @property
    def _middle(self) -> Vector:
        """Middle of the object, m."""
        return self._seen.poses[self.state.object_index, :3, 3]

    @property
    def _upright_axis(self) -> Vector:
        """Axis of the object to be upright, in the world."""
        return self._seen.poses[self.state.object_index, :3, :3] @ self.state.up

    @property
    def _approach_pose(self) -> Vector:
        """Pose of the tip before the straight approach to the grasp."""
        goal = self.state.grasp.copy()
        goal[:3] -= (BESIDE if self.state.leans else _HOVER) * rotation.matrix(goal[3:])[:, 2]
        return goal

    @property
    def _back(self) -> Vector:
        """Displacement of the tip away from a released object, m."""
        return -(BESIDE if self.state.leans else _HOVER) * rotation.matrix(self.hand.line()[3:])[:, 2]

    @property
    def _holds(self) -> bool:
        """Whether the object is held, and the fingers are not shut.

        The engine names one holder, the first of two, and none while a finger is off for a moment.
        """
        return self.state.unheld < _UNHELD and self.hand.angle > _HELD_OPEN

    @property
    def _clings(self) -> bool:
        """Whether both open fingers touch the released object; a ring's corner is wider than its wall."""
        is_open = self.hand.angle > _AS_WIDE * self.state.opening
        return is_open and self._seen.holders[self.state.object_index] == self.hand.number

    @property
    def _is_there(self) -> bool:
        """Whether the tip has settled at its goal, or the wait is over."""
        return self.hand.has_settled or self.state.waited > PATIENCE

    @property
    def _level(self) -> float:
        """Height of the tip of an empty hand above all obstacles, m."""
        return max(self._chore.clear + self.hand.jaw.length, self._approach_pose[2])

    def _let_go(self) -> None:
        self.hand.move_jaw(self.state.opening)
        self._enter(HandPhase.OPEN)

    def _has_lost(self) -> bool:
        """Return whether the object is not held any more; then let go."""
        if self._holds:
            return False
        self._progress.dropped += 1
        self._let_go()
        return True

    def _give_up(self) -> None:
        self.state.object_index = -1
        self._enter(HandPhase.IDLE)
