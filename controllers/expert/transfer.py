"""One hand's way with one thing after the other: what comes next, from what is measured.

A thing is grasped where it is seen, held if the engine says so, brought in line by its own pose over its
place, and taken up again if it has been dropped or is not where it belongs. SI units, poses in the world.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Literal

import numpy as np

from controllers.expert.chores import Chore
from controllers.expert.grasps import Grasps
from controllers.expert.hand import Hand, Phase, pose_of
from controllers.expert.reach import margins
from hub.participant import Record, array, flag, integer
from robots import rotation
from schemas.vectors import Vector

__all__ = ["Progress", "Role", "Seen", "Transfer"]

_HOVER = 0.020
"""Of a tip over its grasp before it goes down and after it has let go, m."""
_ACCURATE, _IN_LINE = 0.2e-3, 0.5e-3
"""m: of a tip at its grasp; of a thing over its place."""
_PATIENCE = 0.6
"""s: for these; then it goes on with what has been reached."""
_ALIGNING = 0.08
"""Time constant with which a thing is brought in line, s."""
_SHUT = -0.3
"""rad: the command to a jaw that grasps."""
_PRESSED, _GIVEN_UP = 0.3, 0.9
"""s: until a jaw holds at the earliest; until it does not."""
_HELD_OPEN = 0.03
"""rad: a jaw commanded to shut that stays this far open has something between its fingers."""
_UNHELD = 0.25
"""s without a holder after which a thing is lost."""
_OPENED = 0.25
"""s: for a jaw to let go."""
_GENTLE = 0.4
"""Share of the speed with which a hand comes down on things."""
_COMFORT, _PER_TURN, _PER_OPENING, _PER_SIDE = 0.25, 0.02, 0.2, 0.2
"""Of a grasp: the joints' margin beyond which more is no better; what a radian of turning and a radian of the
jaw's opening cost, and what a side that leaves room to the other hand is worth, in margins.
"""
_PICKING = {Phase.RISE, Phase.ACROSS, Phase.DESCEND, Phase.CLOSE, Phase.LIFT}
_LEAVING = {Phase.OFFER, Phase.OPEN, Phase.RETREAT}

Role = Literal["alone", "giver", "taker"]


class Progress(Record):
    """Of the task."""

    done = flag()
    placed = integer()
    """How many things are where they belong."""
    attempts = integer()
    """How often a jaw has closed on a thing."""
    dropped = integer()
    """How often a thing was not held any more on its way."""


class Seen(Record):
    """The things as they are measured, by index."""

    poses = array("n", 4, 4)
    holders = array("n")
    """Number of the arm that holds each, 0: none."""


class Transfer:
    """What one hand does."""

    def __init__(self, hand: Hand, role: Role, chore: Chore, seen: Seen, progress: Progress) -> None:
        """Take the hand, its role, the task, and what all hands share."""
        self.hand, self.role, self._chore, self._seen, self._progress = hand, role, chore, seen, progress
        self.state = hand.state
        self.other: Transfer | None = None
        """The other hand, if there is one."""
        self._next: dict[Phase, Callable[[], None]] = {
            Phase.IDLE: self._idle,
            Phase.RISE: self._rise,
            Phase.ACROSS: self._across,
            Phase.DESCEND: self._descend,
            Phase.CLOSE: self._close,
            Phase.LIFT: self._lift,
            Phase.CARRY: self._carry,
            Phase.ALIGN: self._align,
            Phase.LOWER: self._lower,
            Phase.OPEN: self._open,
            Phase.RETREAT: self._retreat,
            Phase.OFFER: self._offer,
            Phase.TAKE: self._take,
        }

    def step(self) -> None:
        """Begin the next phase where the present one is over."""
        seen = self.state.thing >= 0 and self._seen.holders[self.state.thing] != 0.0
        self.state.unheld = 0.0 if seen else self.state.unheld + self.hand.period
        if self.hand.has_arrived:
            self._next[self.state.phase]()

    @property
    def settles(self) -> bool:
        """Whether the tip is to be brought exactly where it was sent."""
        return self.state.phase in (Phase.ACROSS, Phase.DESCEND)

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

    @property
    def _middle(self) -> Vector:
        """Where the middle of the thing is, m."""
        return self._seen.poses[self.state.thing, :3, 3]

    @property
    def _holds(self) -> bool:
        """Whether the thing is held, and something is between the fingers.

        The engine names one holder, of two the first, and none where a finger leaves it for a moment.
        """
        return self.state.unheld < _UNHELD and self.hand.angle > _HELD_OPEN

    @property
    def _length(self) -> float:
        return self.hand.jaw.length

    def _idle(self) -> None:
        thing = self._choice()
        if thing < 0:
            return
        grasp = self._plan(thing)
        if grasp is None:
            return
        self.state.thing = thing
        level = max(self._chore.clear + self._length, self.state.grasp[2] + _HOVER)
        self._enter(Phase.RISE, self._raised(level))

    def _rise(self) -> None:
        goal = self.state.grasp.copy()
        goal[2] = max(self._chore.clear + self._length, goal[2] + _HOVER)
        self.hand.move_jaw(self.state.opening)
        self._enter(Phase.ACROSS, goal)

    def _across(self) -> None:
        if self.hand.error > _ACCURATE and self.state.waited < _PATIENCE:
            return
        if self._plan(self.state.thing) is None:
            self._enter(Phase.IDLE)
            return
        self._enter(Phase.DESCEND, self.state.grasp, _GENTLE)

    def _descend(self) -> None:
        if self.state.waited < _PATIENCE and self._plan(self.state.thing) is not None:
            self.state.goal[:] = self.state.grasp  # the other hand may still bring it to rest
            if self.hand.error > _ACCURATE:
                return
        self.hand.move_jaw(_SHUT)
        self._progress.attempts += 1
        self._enter(Phase.CLOSE)

    def _close(self) -> None:
        if self.state.waited < _PRESSED:
            return
        if self._holds and self._seen.holders[self.state.thing]:
            if self.role == "taker":
                self._enter(Phase.TAKE)
            else:
                up = self._chore.travel - self._middle[2]
                self._enter(Phase.LIFT, self._moved(np.array([0.0, 0.0, up])))
        elif self.state.waited > _GIVEN_UP:
            self._let_go()

    def _lift(self) -> None:
        if self._lost():
            return
        to = self._chore.meeting if self.role == "giver" else self._place()
        self._enter(Phase.CARRY, self._moved(np.append((to - self._middle)[:2], 0.0)))

    def _place(self) -> Vector:
        self.state.place[:] = self._chore.place(self.state.thing, self._seen.poses)
        return self.state.place

    def _carry(self) -> None:
        if self._lost():
            return
        if self.role == "giver":
            self._enter(Phase.OFFER)
            return
        down = self._chore.above(self.state.place) - self._middle[2]
        self._enter(Phase.ALIGN, self._moved(np.array([0.0, 0.0, down])))

    def _align(self) -> None:
        if self._lost():
            return
        off = self.state.place - self._middle
        if hypot(off[0], off[1]) > _IN_LINE and self.state.waited < 2.0 * _PATIENCE:
            self.state.goal[:2] += off[:2] * (self.hand.period / _ALIGNING)
            return
        self._enter(Phase.LOWER, self._moved(np.array([0.0, 0.0, off[2]])), _GENTLE)

    def _lower(self) -> None:
        self._let_go()

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

    def _open(self) -> None:
        if self.state.waited > _OPENED:
            self._enter(Phase.RETREAT, self._moved(np.array([0.0, 0.0, _HOVER])), _GENTLE)

    def _retreat(self) -> None:
        self.state.thing = -1
        self._enter(Phase.IDLE)

    def _offer(self) -> None:
        if self._lost():
            return
        if self.other is not None and self.other.state.phase is Phase.TAKE:
            self._let_go()

    def _take(self) -> None:
        if self.other is not None and self.other.state.phase in _LEAVING:
            return
        if not self._lost():
            up = self._chore.travel - self._middle[2]
            self._enter(Phase.LIFT, self._moved(np.array([0.0, 0.0, up])))

    def _choice(self) -> int:
        """Return the index of the thing to take next, -1: none."""
        other = self.other
        if self.role == "taker":
            return other.state.thing if other is not None and other.state.phase is Phase.OFFER else -1
        if self.role == "alone" and other is not None and other.state.phase in _PICKING:
            return -1
        taken = -1 if other is None else other.state.thing
        for thing in range(len(self._seen.holders)):
            if thing == taken or self._seen.holders[thing] or self._chore.is_done(thing, self._seen.poses):
                continue
            if other is None or self.role == "giver" or self._is_nearer(thing, other):
                return thing
        return -1

    def _is_nearer(self, thing: int, other: Transfer) -> bool:
        """Say whether the place of a thing is nearer to this hand's arm than to the other's."""
        place = self._chore.place(thing, self._seen.poses)[:2]
        mine, others = (np.linalg.norm(each.hand.base[:2, 3] - place) for each in (self, other))
        return bool(mine <= others)

    def _plan(self, thing: int) -> Vector | None:
        """Choose how to take hold of a thing, into `grasp` and `opening`; None: it cannot be taken."""
        pose = self._seen.poses[thing]
        found = self._chore.grasps(thing, pose, self._length)
        if not len(found.poses):
            return None
        score = self._score(thing, found)
        best = int(score.argmax())
        self.state.grasp[:], self.state.opening = pose_of(found.poses[best]), float(found.opening[best])
        return self.state.grasp

    def _score(self, thing: int, found: Grasps) -> Vector:
        middle = self._seen.poses[thing, :3, 3]
        tips = np.repeat(found.poses[:, None], 3, axis=1)
        tips[:, 1, 2, 3] += self._chore.travel - middle[2]
        if self.role != "alone" and self.other is not None:
            end = self._chore.meeting
        else:
            end = self._chore.place(thing, self._seen.poses)
        tips[:, 2, :3, 3] += end - middle
        score = np.minimum(margins(self.hand.chain, self.hand.base, tips), _COMFORT)
        now = self.hand.line()[3:]
        turns = [
            rotation.log(rotation.product(pose_of(tip)[3:], rotation.conjugate(now))) for tip in found.poses
        ]
        score -= _PER_TURN * np.linalg.norm(turns, axis=1) + _PER_OPENING * found.opening
        if self.role != "alone" and self.other is not None:
            away = (self.hand.base - self.other.hand.base)[:2, 3]
            score += _PER_SIDE * found.outwards @ (away / np.linalg.norm(away))
        return score
