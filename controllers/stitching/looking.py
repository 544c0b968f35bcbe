"""Before a stitch, each hand in turn comes over the pad, until a tracker has shown the tip.

The way there is blind, as wrong as the joints are. The hands go in turn and do not meet. SI units.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.sight import Sight
from hub.participant import Record, array, choice, integer, number
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Looking"]

_ABOVE = 0.03
"""m over the skin: twice the effect of the bounds of joint errors on a tip 130 mm from its remote centre."""
_PATIENCE = 10.0
"""s there without knowing where the tip is."""


class LookingPhase(IntEnum):
    """Motion of the hand at work."""

    NOWHERE = 0
    INTO_VIEW = 1
    BACK = 2


class LookingState(Record):
    """How far the looking is."""

    at_work = integer()
    """Number of the hand."""
    going = choice(LookingPhase.NOWHERE)
    waited = number()
    """Time in view, s."""
    back = array(7)
    """Pose before the motion."""


class Looking:
    """Brings the hands into view."""

    def __init__(self, hands: Sequence[RobotHand], sights: Sequence[Sight], pad: Vector) -> None:
        """Accept the hands with their sights, and the pad's pose in the world, shape (4, 4)."""
        self._hands, self._sights = hands, sights
        self._over = pad[:3, 3] + _ABOVE * pad[:3, 2]
        self.state = LookingState()

    def step(self) -> bool:
        """Advance the motion, and return whether the places of all tips are known.

        Raises MotionError if a tip is not seen in time.
        """
        state = self.state
        while state.going is LookingPhase.NOWHERE:
            if state.at_work == len(self._hands):
                return True
            if not self._sights[state.at_work].is_known:
                state.back[:] = self._hands[state.at_work].measured
                goal = np.concatenate([self._over, state.back[3:]])
                self._send(goal, LookingPhase.INTO_VIEW)
                return False
            state.at_work += 1
        hand = self._hands[state.at_work]
        if not hand.has_arrived:
            return False
        if state.going is LookingPhase.BACK:
            state.going = LookingPhase.NOWHERE
            return False
        state.waited += hand.period
        if self._sights[state.at_work].is_known:
            self._send(state.back, LookingPhase.BACK)
        elif state.waited > _PATIENCE:
            raise MotionError(
                f"{hand.arm} has been over the pad for {_PATIENCE:.0f} s, and no tracker has shown well"
                " enough where its tip is: is it in the endoscope's view?"
            )
        return False

    def _send(self, goal: Vector, going: LookingPhase) -> None:
        hand = self._hands[self.state.at_work]
        hand.stay()
        hand.go(goal)
        self.state.going, self.state.waited = going, 0.0
