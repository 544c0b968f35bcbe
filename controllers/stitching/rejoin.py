"""How the hands come from their present places to where a stitch goes on. SI units, world.

The free hand opens and goes clear of the needle, then each hand goes on a line to the beginning of its
phase.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.stitching.geometry import approach_pose
from controllers.stitching.phase import StitchPhase
from controllers.stitching.way_on import WayOn
from hub.participant import Record, array, choice, number
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.vectors import Vector

__all__ = ["BACK", "OPEN", "OPENED", "SHUT", "Rejoin"]

OPEN, SHUT = 0.70, -0.30
"""Jaw openings, rad: around a wire, and holding."""
OPENED = 0.3
"""s: for a jaw to let go."""
BACK = 0.016
"""Distance from a hold, m, against the fingers: clear of the wire."""
_CLEAR = 0.04
"""m; a free hand nearer to the needle goes back first."""
_GENTLE = 0.35


class RejoinPhase(IntEnum):
    """Motion of the hands."""

    NOWHERE = 0
    OPEN = 1
    CLEAR = 2
    GO = 3


class RejoinState(Record):
    """Where the hands go."""

    going = choice(RejoinPhase.NOWHERE)
    then = choice(StitchPhase.BEGIN)
    """Phase after the motion."""
    goals = array(2, 7)
    """Goals of driver and puller, the poses at the start of the phase."""
    holder = number()
    waited = number()


class Rejoin:
    """The way of driver and puller to where a stitch goes on."""

    def __init__(self, driver: RobotHand, puller: RobotHand) -> None:
        self._hands, self.state = (driver, puller), RejoinState()

    @property
    def is_under_way(self) -> bool:
        """Whether the hands have not yet come there."""
        return self.state.going is not RejoinPhase.NOWHERE

    def begin(self, plan: WayOn, grip: Vector, park: Vector) -> None:
        """Open the jaws that do not hold the needle.

        Args:
            plan: how the stitch goes on.
            grip: pose of the holding hand's tip in the needle's frame, shape (4, 4).
            park: resting poses of driver and puller, shape (2, 7).
        """
        state = self.state
        for hand in self._hands:
            hand.move_jaw(SHUT if hand is plan.holder else OPEN)
        state.goals[:] = park
        if plan.holder is not None:
            state.goals[self._hands.index(plan.holder)] = matrix_to_pose(plan.needle @ grip)
        driver = int(plan.exchanged)
        puller = driver if plan.alone else 1 - driver
        if plan.phase is StitchPhase.HOVER:
            picker = 1 - driver if len(plan.handed) % 2 else driver
            grip = plan.driver if plan.pick is None else plan.pick
            state.goals[picker] = approach_pose(plan.needle @ grip, BACK)
        elif plan.phase is StitchPhase.COME:
            state.goals[puller] = approach_pose(plan.needle @ plan.puller, BACK)
        state.going, state.then, state.waited = RejoinPhase.OPEN, plan.phase, 0.0
        state.holder = 0.0 if plan.holder is None else plan.holder.number

    def give_up(self) -> None:
        """Go nowhere any more."""
        self.state.going = RejoinPhase.NOWHERE

    def step(self, needle: Vector) -> None:
        """Go on; `needle`: pose of the needle, shape (4, 4)."""
        state, hands = self.state, self._hands
        state.waited += hands[0].period
        if state.going is RejoinPhase.OPEN and state.waited >= OPENED:
            for hand in hands:
                near = float(np.linalg.norm(hand.measured[:3] - needle[:3, 3])) < _CLEAR
                if hand.number != state.holder and near:
                    hand.go(approach_pose(pose_to_matrix(hand.line()), BACK))
            state.going = RejoinPhase.CLEAR
        elif state.going is RejoinPhase.CLEAR and all(hand.has_arrived for hand in hands):
            for hand, goal in zip(hands, state.goals, strict=True):
                hand.go(goal, _GENTLE if hand.number == state.holder else 1.0)
            state.going = RejoinPhase.GO
        elif state.going is RejoinPhase.GO and all(hand.has_arrived for hand in hands):
            state.going = RejoinPhase.NOWHERE
