"""One hand's way with one thing after the other: what comes next, from what is measured.

A thing is grasped where it is seen, held if the engine says so, put upright if it has fallen, brought in
line by its own pose over its place, and taken up again if it has been dropped or is not where it belongs. SI
units, poses in the world.
"""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, hypot

import numpy as np

from controllers.expert.fallen_rings import BESIDE
from controllers.expert.grasps import AJAR, UPRIGHT, Grasps
from controllers.expert.hand import Hand, Phase, Role, framed
from controllers.expert.plans import Plan, plan, plan_leaning, upright
from controllers.expert.team import Refusals, Team
from robots import rotation
from schemas.vectors import Vector

__all__ = ["Transfer"]

_HOVER = 0.020
"""Of a tip over its grasp before it goes down and after it has let go, m."""
_IN_LINE = 0.5e-3
"""m: of a thing over its place."""
_PATIENCE = 0.6
"""s: for this, and for a tip to settle; then it goes on with what has been reached."""
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
_WIDEST = 0.8
"""rad: so far a jaw opens, a step of `AJAR` at a time, while what it let go of clings to its fingers."""
_AS_WIDE = 0.9
"""Share of its opening at which a jaw that still touches what it let go of does not come free by itself."""
_STRUCK = 2.0e-3
"""m: a tip that comes down so far from its line has struck something, with about 10 N; else it is 0.5 mm."""
_GENTLE = 0.4
"""Share of the speed with which a hand comes down on things."""
_OFFERED = 20.0
"""s: for the other hand to take what is offered; it may have to put something down before."""
_TURNING = 0.015
"""m: so much higher than it travels a thing is put upright, as it swings about the tip."""
_SAME = cos(0.05)
"""Of half the turn between two plans for the same grasp."""
_STRAIGHT, _TURNS = 0.05, 3
"""rad: of a thing that is upright; how often a hand turns to bring it there."""
_APPROACHING = {Phase.RISE, Phase.ACROSS, Phase.DESCEND, Phase.REACH}
_GIVING_UP = {Phase.OPEN, Phase.RETREAT, Phase.IDLE}
_LEAVING = {Phase.OFFER, Phase.OPEN, Phase.RETREAT}


class Transfer:
    """What one hand does."""

    def __init__(self, hand: Hand, team: Team, things: int) -> None:
        """Take the hand, its team, and how many things there are."""
        self.hand, self.team, self.state = hand, team, hand.state
        self._chore, self._seen, self._progress = team.chore, team.seen, team.progress
        self.refusals = Refusals(n=things)
        self._next: dict[Phase, Callable[[], None]] = {
            Phase.IDLE: self._idle,
            Phase.RISE: self._rise,
            Phase.ACROSS: self._across,
            Phase.DESCEND: self._descend,
            Phase.REACH: self._reach,
            Phase.CLOSE: self._close,
            Phase.LIFT: self._lift,
            Phase.TURN: self._turn,
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
        self.refusals.things[self._seen.still == 0.0] = 0.0
        if self.state.phase is Phase.DESCEND and not self.state.leans and self.hand.lag > _STRUCK:
            self._back_off()
        elif self.hand.has_arrived:
            self._next[self.state.phase]()

    def _back_off(self) -> None:
        """Leave a thing beside which, or on which, the fingers have come down."""
        self._seen.tries[self.state.thing] += 1.0
        self.hand.stay()
        self._let_go()

    def refuse(self) -> bool:
        """Leave the thing after a command on the way to it was refused; return whether that is possible.

        Commands that were under way may be refused afterwards.
        """
        if self.state.phase not in _APPROACHING:
            return self.state.phase in _GIVING_UP and bool(self.refusals.things.any())
        self.refusals.things[self.state.thing] = 1.0
        self.hand.stay()
        self.state.correction[:] = 0.0
        self._let_go()
        return True

    @property
    def settles(self) -> bool:
        """Whether the tip is to be brought exactly where it was sent."""
        return self.state.phase in (Phase.ACROSS, Phase.DESCEND, Phase.REACH)

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
        height = self._chore.travel + (_TURNING if self.state.leans else 0.0)
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
        return self.hand.has_settled or self.state.waited > _PATIENCE

    @property
    def _level(self) -> float:
        """Height of the tip at which an empty hand passes over everything, m."""
        return max(self._chore.clear + self.hand.jaw.length, self._before[2])

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
        self._enter(Phase.DESCEND, self.state.grasp, _GENTLE)

    def _go_beside(self) -> None:
        """Go down beside a fallen thing, if it still lies there."""
        if self._seen.is_free(self.state.thing):
            self._enter(Phase.DESCEND, self._before, _GENTLE)
        else:
            self._give_up()

    def _give_up(self) -> None:
        self.state.thing = -1
        self._enter(Phase.IDLE)

    def _descend(self) -> None:
        if self.state.leans:
            if self._is_there:
                self._enter(Phase.REACH, self.state.grasp, _GENTLE)
            return
        if self.state.waited < _PATIENCE and (found := self._plan(self.state.thing)) and self._goes_on(found):
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
        if self.state.waited <= _OPENED:
            return
        if self._clings and self.state.opening + AJAR <= _WIDEST:
            self.state.opening += AJAR
            self._let_go()
        else:
            self._enter(Phase.RETREAT, self._moved(self._back), _GENTLE)

    def _retreat(self) -> None:
        """Leave what was let go of; if it has come along, put it down again, and open further."""
        if self._clings and self.state.opening + AJAR <= _WIDEST:
            self.state.opening += AJAR
            self._enter(Phase.LOWER, self._moved(-self._back), _GENTLE)
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
            return plan_leaning(hand, found, middle, lift + _TURNING, rest)
        to, away = self._chore.meeting, np.zeros(2)
        if role is not Role.GIVER:
            to = self._chore.place(thing, poses, self.team.destination(self))
        if role is not Role.ALONE and (other := self.team.other(self)) is not None:
            away = (hand.base - other.hand.base)[:2, 3]
            away /= np.linalg.norm(away)
        return plan(hand, found, lift, to - middle, away, self._chore.room)
