"""What a hand is about: where it and its thing are, whether it holds, and what it may do at any time.

SI units, poses in the world.
"""

from __future__ import annotations

import numpy as np

from controllers.expert.fallen_rings import BESIDE
from controllers.expert.hand import Hand, Phase
from controllers.expert.team import Refusals, Team
from robots import rotation
from schemas.vectors import Vector

__all__ = ["GENTLE", "PATIENCE", "TURNING", "Errand"]

PATIENCE = 0.6
"""s for which a hand tries to bring its tip or its thing where it is sent; then it goes on with what it has
reached.
"""
GENTLE = 0.4
"""Share of the speed with which a hand comes down on things."""
TURNING = 0.015
"""m: so much higher than it travels a thing is put upright, as it swings about the tip."""
_HOVER = 0.020
"""Of a tip over its grasp before it goes down and after it has let go, m."""
_HELD_OPEN = 0.03
"""rad: a jaw commanded to shut that stays this far open has something between its fingers."""
_UNHELD = 0.25
"""s without a holder after which a thing is lost."""
_AS_WIDE = 0.9
"""Share of its opening at which a jaw that still touches what it let go of does not come free by itself."""


class Errand:
    """Of one hand, with one thing after the other."""

    def __init__(self, hand: Hand, team: Team, things: int) -> None:
        """Take the hand, its team, and how many things there are."""
        self.hand, self.team, self.state = hand, team, hand.state
        self._chore, self._seen, self._progress = team.chore, team.seen, team.progress
        self.refusals = Refusals(n=things)

    def _enter(self, phase: Phase, goal: Vector | None = None, share: float = 1.0) -> None:
        """Begin `phase`, with a line to `goal` or, without one, where the tip stands."""
        self.state.phase, self.state.waited = phase, 0.0
        self.hand.go(self.hand.line() if goal is None else goal, share)

    def _raised(self, height: float) -> Vector:
        """Return the pose of the tip's line, not below `height`."""
        goal = self.hand.line()
        goal[2] = max(goal[2], height)
        return goal

    def _moved(self, by: Vector) -> Vector:
        goal = self.hand.line()
        goal[:3] += by
        return goal

    def _lifted(self) -> Vector:
        """Return the pose of the tip at which the thing's middle is as high as it travels."""
        height = self._chore.travel + (TURNING if self.state.leans else 0.0)
        return self._moved(np.array([0.0, 0.0, height - self._middle[2]]))

    @property
    def _middle(self) -> Vector:
        """Where the middle of the thing is, m."""
        return self._seen.poses[self.state.thing, :3, 3]

    @property
    def _up(self) -> Vector:
        """The axis of the thing that is to be up, in the world."""
        return self._seen.poses[self.state.thing, :3, :3] @ self.state.up

    @property
    def _before(self) -> Vector:
        """The pose of the tip from which its fingers go straight to the grasp."""
        goal = self.state.grasp.copy()
        goal[:3] -= (BESIDE if self.state.leans else _HOVER) * rotation.matrix(goal[3:])[:, 2]
        return goal

    @property
    def _back(self) -> Vector:
        """The way on which a hand leaves what it has let go of, m."""
        return -(BESIDE if self.state.leans else _HOVER) * rotation.matrix(self.hand.line()[3:])[:, 2]

    @property
    def _holds(self) -> bool:
        """Whether the thing is held, and something is between the fingers.

        The engine names one holder, of two the first, and none where a finger leaves it for a moment.
        """
        return self.state.unheld < _UNHELD and self.hand.angle > _HELD_OPEN

    @property
    def _clings(self) -> bool:
        """Whether open fingers both touch what was let go of; a ring's corner is wider than its wall."""
        is_open = self.hand.angle > _AS_WIDE * self.state.opening
        return is_open and self._seen.holders[self.state.thing] == self.hand.number

    @property
    def _is_there(self) -> bool:
        """Whether the tip rests where it was sent, or has tried for long enough."""
        return self.hand.has_settled or self.state.waited > PATIENCE

    @property
    def _level(self) -> float:
        """Height of the tip at which an empty hand passes over everything, m."""
        return max(self._chore.clear + self.hand.jaw.length, self._before[2])

    def _let_go(self) -> None:
        self.hand.move_jaw(self.state.opening)
        self._enter(Phase.OPEN)

    def _lost(self) -> bool:
        """Say whether the thing is not held any more; the hand then gives up."""
        if self._holds:
            return False
        self._progress.dropped += 1
        self._let_go()
        return True

    def _give_up(self) -> None:
        self.state.thing = -1
        self._enter(Phase.IDLE)
