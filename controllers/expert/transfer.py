"""One hand's way with one thing after the other: what comes next, from what is measured.

A thing is grasped where it is seen, held if the engine says so, put upright if it has fallen, brought in
line by its own pose over its place, and taken up again if it has been dropped or is not where it belongs. SI
units, poses in the world.
"""

from __future__ import annotations

from collections.abc import Callable

from controllers.expert.carrying import Carrying
from controllers.expert.hand import Hand, Phase
from controllers.expert.taking import Taking
from controllers.expert.team import Team

__all__ = ["Transfer"]

_STRUCK = 2.0e-3
"""m: a tip that comes down so far from its line has struck something, with about 10 N; else it is 0.5 mm."""
_APPROACHING = {Phase.RISE, Phase.ACROSS, Phase.DESCEND, Phase.REACH}
_GIVING_UP = {Phase.OPEN, Phase.RETREAT, Phase.IDLE}


class Transfer(Taking, Carrying):
    """What one hand does."""

    def __init__(self, hand: Hand, team: Team, things: int) -> None:
        """Take the hand, its team, and how many things there are."""
        super().__init__(hand, team, things)
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

        On the way back from a thing that is let go, the hand stays where it is. Commands that were under way
        may be refused afterwards.
        """
        if self.state.phase is Phase.RETREAT and not self._clings:
            self.hand.stay()
            self._give_up()
            return True
        if self.state.phase not in _APPROACHING:
            left = self.state.thing < 0 or bool(self.refusals.things.any())
            return self.state.phase in _GIVING_UP and left
        self.refusals.things[self.state.thing] = 1.0
        self.hand.stay()
        self.state.correction[:] = 0.0
        self._let_go()
        return True

    @property
    def settles(self) -> bool:
        """Whether the tip is to be brought exactly where it was sent."""
        return self.state.phase in (Phase.ACROSS, Phase.DESCEND, Phase.REACH)
