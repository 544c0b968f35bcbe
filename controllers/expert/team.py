"""Which hand takes which thing next, and as what."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from controllers.expert.chores import Chore
from controllers.expert.hand import Phase, Role
from controllers.expert.progress import Progress, Seen, Verdict
from hub.participant import Record, array

if TYPE_CHECKING:
    from controllers.expert.errand import Errand

__all__ = ["Refusals", "Team"]

_TRIES = 8
"""How often jaws close on a thing in one leg before it is left; a hand-over of a fallen ring takes three."""
_PICKING = {Phase.RISE, Phase.ACROSS, Phase.DESCEND, Phase.REACH, Phase.CLOSE, Phase.LIFT}


class Refusals(Record):
    """Of one hand."""

    things = array("n")
    """1 for each thing that it has no way to take, where it lies now."""


class Team:
    """One hand, two that work side by side, or two that give things to one another.

    Each thing that is given is taken by the hand of the side where it is and put down by the other one on its
    own side. So a ring that has been dropped where it belongs goes back first: without a hand-over it would
    not count.
    """

    def __init__(self, chore: Chore, seen: Seen, progress: Progress, *, hand_over: bool) -> None:
        """Take the task, what all hands share, and whether two hands give things to one another."""
        self.chore, self.seen, self.progress, self._hand_over = chore, seen, progress, hand_over
        self.hands: list[Errand] = []
        self._sides: dict[str, int] = {}

    def add(self, hand: Errand) -> None:
        """Add a hand; the surgeon's right one first."""
        self.hands.append(hand)

    def other(self, hand: Errand) -> Errand | None:
        """Return the other hand, if there is one."""
        return next((each for each in self.hands if each is not hand), None)

    @property
    def goal(self) -> int:
        """The side to which things go in this leg."""
        return 1 - self.progress.leg % 2

    def side_of(self, hand: Errand) -> int:
        """Return the side that a hand serves: that which is nearer to it than to the other one."""
        arm = hand.hand.arm
        if arm not in self._sides:
            nearer = [self._distance(hand, side) for side in (0, 1)]
            other = self.other(hand)
            others = [0.0, 0.0] if other is None else [self._distance(other, side) for side in (0, 1)]
            self._sides[arm] = int(nearer[1] - others[1] < nearer[0] - others[0])
        return self._sides[arm]

    def _distance(self, hand: Errand, side: int) -> float:
        return float(np.linalg.norm((hand.hand.base[:3, 3] - self.chore.middle_of(side))[:2]))

    def destination(self, hand: Errand) -> int:
        """Return the side on which `hand` puts down what it has."""
        return self.side_of(hand) if hand.state.role is Role.TAKER else self.goal

    def is_done(self, thing: int) -> bool:
        """Say whether a thing is where it belongs in this leg."""
        return self.chore.is_done(thing, self.seen.poses, self.goal)

    def choice(self, hand: Errand) -> tuple[int, Role]:
        """Return the index of the thing that `hand` is to take next, -1 for none, and as what."""
        return self._exchange(hand) if self._hand_over else (self._next(hand), Role.ALONE)

    def _exchange(self, hand: Errand) -> tuple[int, Role]:
        other = self.other(hand)
        if other is None:
            return -1, Role.ALONE
        if other.state.phase is Phase.OFFER:
            return other.state.thing, Role.TAKER
        if other.state.thing >= 0 and other.state.role is not Role.TAKER:
            return -1, Role.ALONE  # one gives at a time
        side = self.side_of(hand)
        for thing in self._open(hand):
            if self.chore.side(thing, self.seen.poses) == side:
                return thing, Role.GIVER
        return -1, Role.ALONE

    def _next(self, hand: Errand) -> int:
        other = self.other(hand)
        if other is not None and other.state.phase in _PICKING:
            return -1  # they would meet
        for thing in self._open(hand):
            if other is None or other.refusals.things[thing] or self._is_nearer(thing, hand, other):
                return thing
        return -1

    def _open(self, hand: Errand) -> list[int]:
        """Return the things that `hand` might take."""
        seen, other = self.seen, self.other(hand)
        taken = -1 if other is None else other.state.thing
        return [
            thing
            for thing in range(len(seen.holders))
            if thing != taken
            and seen.is_free(thing)
            and not hand.refusals.things[thing]
            and not self.is_done(thing)
        ]

    def _is_nearer(self, thing: int, hand: Errand, other: Errand) -> bool:
        """Say whether the place of a thing is nearer to this hand's arm than to the other's."""
        place = self.chore.place(thing, self.seen.poses, self.goal)[:2]
        mine, others = (np.linalg.norm(each.hand.base[:2, 3] - place) for each in (hand, other))
        return bool(mine <= others)

    def judge(self) -> None:
        """Say of each thing whether it is left where it is."""
        seen, chore = self.seen, self.chore
        for thing in range(len(seen.holders)):
            if chore.depth > seen.poses[thing, 2, 3]:
                seen.verdicts[thing] = Verdict.LOST
            elif seen.verdicts[thing] == Verdict.NONE and not seen.holders[thing]:
                if seen.tries[thing] >= _TRIES and not self.is_done(thing):
                    seen.verdicts[thing] = Verdict.BLOCKED
                elif all(hand.refusals.things[thing] for hand in self._eligible(thing)):
                    seen.verdicts[thing] = Verdict.NOT_REACHABLE

    def _eligible(self, thing: int) -> list[Errand]:
        """Return the hands that may take a thing up."""
        if not self._hand_over:
            return self.hands
        side = self.chore.side(thing, self.seen.poses)
        return [hand for hand in self.hands if self.side_of(hand) == side]
