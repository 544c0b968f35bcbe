"""State machine of a hand: the next phase from measurements.

An object is grasped at its measured pose, counts as held if the engine reports a holder, is put upright after
a fall, aligned over its target by the object's own pose, and picked up again after a drop or a miss. SI
units, poses in the world.
"""

from __future__ import annotations

from collections.abc import Callable

from controllers.expert.carrying import Carrying
from controllers.expert.hand import HandPhase, RobotHand
from controllers.expert.taking import Taking
from controllers.expert.team import Team

__all__ = ["Transfer"]

_STRUCK = 2.0e-3
"""Error of a tip in descent after a collision, m (about 10 N); without contact the error is 0.5 mm."""
_APPROACHING = {HandPhase.RISE, HandPhase.ACROSS, HandPhase.DESCEND, HandPhase.REACH}
_GIVING_UP = {HandPhase.OPEN, HandPhase.RETREAT, HandPhase.IDLE}


class Transfer(Taking, Carrying):
    """Picks and places one object after the other."""

    def __init__(self, hand: RobotHand, team: Team, objects: int) -> None:
        """`objects`: number of objects of the scene."""
        super().__init__(hand, team, objects)
        self._next: dict[HandPhase, Callable[[], None]] = {
            HandPhase.IDLE: self._idle,
            HandPhase.RISE: self._rise,
            HandPhase.ACROSS: self._across,
            HandPhase.DESCEND: self._descend,
            HandPhase.REACH: self._reach,
            HandPhase.CLOSE: self._close,
            HandPhase.LIFT: self._lift,
            HandPhase.TURN: self._turn,
            HandPhase.CARRY: self._carry,
            HandPhase.ALIGN: self._align,
            HandPhase.LOWER: self._lower,
            HandPhase.OPEN: self._open,
            HandPhase.RETREAT: self._retreat,
            HandPhase.OFFER: self._offer,
            HandPhase.TAKE: self._take_object,
        }

    def step(self) -> None:
        """Begin the next phase if the present phase is over."""
        seen = self.state.object_index >= 0 and self._seen.holders[self.state.object_index] != 0.0
        self.state.unheld = 0.0 if seen else self.state.unheld + self.hand.period
        self.refusals.objects[self._seen.still == 0.0] = 0.0
        if self.state.phase is HandPhase.DESCEND and not self.state.leans and self.hand.lag > _STRUCK:
            self._back_off()
        elif self.hand.has_arrived:
            self._next[self.state.phase]()

    def _back_off(self) -> None:
        """Leave an object after the fingers have struck the object or its surroundings."""
        self._seen.tries[self.state.object_index] += 1.0
        self.hand.stay()
        self._let_go()

    def refuse(self) -> bool:
        """Leave the object after the refusal of a command; return whether the hand can go on.

        A hand on its way to an object gives the object up. A hand in retreat stops. Later refusals of
        commands still on their way are ignored.
        """
        if self.state.phase is HandPhase.RETREAT and not self._clings:
            self.hand.stay()
            self._give_up()
            return True
        if self.state.phase not in _APPROACHING:
            left = self.state.object_index < 0 or bool(self.refusals.objects.any())
            return self.state.phase in _GIVING_UP and left
        self.refusals.objects[self.state.object_index] = 1.0
        self.hand.stay()
        self.state.correction[:] = 0.0
        self._let_go()
        return True

    @property
    def settles(self) -> bool:
        """Whether the measured error of the tip is corrected at the end of the line."""
        return self.state.phase in (HandPhase.ACROSS, HandPhase.DESCEND, HandPhase.REACH)
