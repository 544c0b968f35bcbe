"""Assignment of objects and roles to hands."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from controllers.expert.chore import Chore
from controllers.expert.hand import HandPhase, HandRole, HandState, RobotHand
from controllers.expert.progress import ObservedObjects, Progress, Verdict
from hub.participant import Record, array

__all__ = ["Refusals", "Team", "TeamMember"]

_TRIES = 8
"""Grasps of an object per leg before the object is left; a hand-over of a fallen ring needs three."""
_PICKING = {
    HandPhase.RISE,
    HandPhase.ACROSS,
    HandPhase.DESCEND,
    HandPhase.REACH,
    HandPhase.CLOSE,
    HandPhase.LIFT,
}


class Refusals(Record):
    """Objects refused by a hand."""

    objects = array("n")
    """1 for each object out of the hand's reach at the object's present place."""


class TeamMember(Protocol):
    """A hand with its task, as a team sees it."""

    hand: RobotHand
    state: HandState
    refusals: Refusals


class Team:
    """A hand, two hands side by side, or two hands with hand-over.

    In a hand-over the hand on the object's side takes the object, and the second hand puts the object down on
    its own side. A ring dropped on its target side is therefore carried back first: without a hand-over the
    ring would not count.
    """

    def __init__(self, chore: Chore, seen: ObservedObjects, progress: Progress, *, hand_over: bool) -> None:
        """`seen` and `progress` are shared by all hands; `hand_over`: two hands pass objects on."""
        self.chore, self.seen, self.progress, self._hand_over = chore, seen, progress, hand_over
        self.hands: list[TeamMember] = []
        self._sides: dict[str, int] = {}

    def add(self, hand: TeamMember) -> None:
        """Add a hand; the surgeon's right hand first."""
        self.hands.append(hand)

    def other(self, hand: TeamMember) -> TeamMember | None:
        """Return the second hand of a team, seen from `hand`; None: `hand` works alone."""
        return next((each for each in self.hands if each is not hand), None)

    @property
    def goal(self) -> int:
        """Target side of this leg."""
        return 1 - self.progress.leg % 2

    def side_of(self, hand: TeamMember) -> int:
        """Return the side nearest to a hand, relative to the other hand."""
        arm = hand.hand.arm
        if arm not in self._sides:
            nearer = [self._distance(hand, side) for side in (0, 1)]
            other = self.other(hand)
            others = [0.0, 0.0] if other is None else [self._distance(other, side) for side in (0, 1)]
            self._sides[arm] = int(nearer[1] - others[1] < nearer[0] - others[0])
        return self._sides[arm]

    def _distance(self, hand: TeamMember, side: int) -> float:
        return float(np.linalg.norm((hand.hand.base[:3, 3] - self.chore.middle_of(side))[:2]))

    def destination(self, hand: TeamMember) -> int:
        """Return the side on which `hand` puts down its object."""
        return self.side_of(hand) if hand.state.role is HandRole.TAKER else self.goal

    def is_done(self, index: int) -> bool:
        """Return whether an object is at its target of this leg."""
        return self.chore.is_done(index, self.seen.poses, self.goal)

    def choice(self, hand: TeamMember) -> tuple[int, HandRole]:
        """Return index and role of the next object of `hand`; -1: none."""
        return self._choose_exchange(hand) if self._hand_over else (self._next(hand), HandRole.ALONE)

    def _choose_exchange(self, hand: TeamMember) -> tuple[int, HandRole]:
        other = self.other(hand)
        if other is None:
            return -1, HandRole.ALONE
        if other.state.phase is HandPhase.OFFER:
            return other.state.object_index, HandRole.TAKER
        if other.state.object_index >= 0 and other.state.role is not HandRole.TAKER:
            return -1, HandRole.ALONE  # one hand-over at a time
        side = self.side_of(hand)
        for index in self._open(hand):
            if self.chore.side(index, self.seen.poses) == side:
                return index, HandRole.GIVER
        return -1, HandRole.ALONE

    def _next(self, hand: TeamMember) -> int:
        other = self.other(hand)
        if other is not None and other.state.phase in _PICKING:
            return -1  # the hands would collide
        for index in self._open(hand):
            if other is None or other.refusals.objects[index] or self._is_nearer(index, hand, other):
                return index
        return -1

    def _open(self, hand: TeamMember) -> list[int]:
        """Return the objects open to `hand`."""
        seen, other = self.seen, self.other(hand)
        taken = -1 if other is None else other.state.object_index
        return [
            index
            for index in range(len(seen.holders))
            if index != taken
            and seen.is_free(index)
            and not hand.refusals.objects[index]
            and not self.is_done(index)
        ]

    def _is_nearer(self, index: int, hand: TeamMember, other: TeamMember) -> bool:
        """Return whether an object's target is nearer to the arm of `hand` than to the arm of `other`."""
        place = self.chore.place(index, self.seen.poses, self.goal)[:2]
        mine, others = (np.linalg.norm(each.hand.base[:2, 3] - place) for each in (hand, other))
        return bool(mine <= others)

    def judge(self) -> None:
        """Update the verdict on each object."""
        seen, chore = self.seen, self.chore
        for index in range(len(seen.holders)):
            if chore.depth > seen.poses[index, 2, 3]:
                seen.verdicts[index] = Verdict.LOST
            elif seen.verdicts[index] == Verdict.NONE and not seen.holders[index]:
                if seen.tries[index] >= _TRIES and not self.is_done(index):
                    seen.verdicts[index] = Verdict.BLOCKED
                elif all(hand.refusals.objects[index] for hand in self._eligible_hands(index)):
                    seen.verdicts[index] = Verdict.NOT_REACHABLE

    def _eligible_hands(self, index: int) -> list[TeamMember]:
        """Return the hands allowed to pick an object up."""
        if not self._hand_over:
            return self.hands
        side = self.chore.side(index, self.seen.poses)
        return [hand for hand in self.hands if self.side_of(hand) == side]
