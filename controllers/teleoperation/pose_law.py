"""The pose law: the tip moves as the hand does, scaled, and turns with it, relative to a reference.

As on the real dVRK (jhu-dvrk/sawIntuitiveResearchKit, mtsTeleOperationPSM.cpp, RunEnabled), with x and H
position and orientation of the hand in its base frame, p and P those of the tip in the arm's, R the
orientation of the one frame in the other, s the scale, and 0 for the reference:

    p = p0 + s R (x - x0),    P = R H A0  with  A0 = (R H0)' P0.

A reference is taken from where hand and command are whenever the hand takes over, and from the *last* hand
and goal when scale or view change while it leads: so no change moves the tip, and no motion of the hand is
lost. It is also taken again while the tip, at a limit of its joints, is turned too far away from the goal:
past half a turn the nearest way there is the other way round.
"""

from __future__ import annotations

from math import radians, sqrt

from hub.participant import Record, array, number
from robots import rotation
from robots.inverse_kinematics import pursue
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["PoseLaw"]

_MOST_LAG = radians(90.0)
"""Of the tip's orientation behind its goal: half of where it would turn round; ours."""


class PoseLawState(Record):
    """The goal and the reference; poses are (x, y, z, qx, qy, qz, qw)."""

    goal = array(7)
    """Of the tip, in the arm's base frame."""
    hand_reference = array(7)
    tip_reference = array(7)
    hand = array(7)
    """Newest pose of the hand, in its base frame."""
    to_base = array(4)
    """Orientation of the hand's base frame in the arm's."""
    scale = number()


class PoseLaw:
    """From poses of the hand to joint positions."""

    def __init__(self, chain: SerialChain, *, turns: bool) -> None:
        """Take the arm's kinematics, and whether the tip turns with the hand or keeps its orientation."""
        self._chain, self._turns = chain, turns
        self.state = PoseLawState()
        self.goal, self._hand, self._to_base = self.state.goal, self.state.hand, self.state.to_base
        self._hand0, self._tip0 = self.state.hand_reference, self.state.tip_reference
        self.goal[6] = self._to_base[3] = 1.0

    def engage(self, hand: Vector, tip: Vector, to_base: Vector, scale: float) -> None:
        """Take the reference: the hand at `hand` is the tip at `tip`, both (x, y, z, qx, qy, qz, qw).

        Args:
            hand: in the hand's base frame.
            tip: at the command, in the arm's base frame.
            to_base: orientation of the one frame in the other, quaternion.
            scale: metres of the tip per metre of the hand.
        """
        self._hand0[:] = self._hand[:] = hand
        self._tip0[:] = self.goal[:] = tip
        self._to_base[:], self.state.scale = to_base, scale

    def step(
        self, command: Vector, hand: Vector, tip: Vector, to_base: Vector, scale: float, largest_move: Vector
    ) -> Vector:
        """Return the joint positions, shape (n,), that follow `command` with the hand at `hand`.

        Arguments are those of `engage` and `robots.inverse_kinematics.pursue`.
        """
        if scale != self.state.scale or (to_base != self._to_base).any():
            self.engage(self._hand.copy(), self.goal.copy(), to_base, scale)
        self._hand[:] = hand
        self.goal[:3] = self._tip0[:3] + scale * (
            rotation.matrix(self._to_base) @ (hand[:3] - self._hand0[:3])
        )
        if self._turns:
            offset = rotation.product(
                rotation.conjugate(rotation.product(to_base, self._hand0[3:])), self._tip0[3:]
            )
            goal = rotation.product(rotation.product(to_base, hand[3:]), offset)
            self.goal[3:] = goal / sqrt(goal.dot(goal))
            lag = rotation.log(rotation.product(self.goal[3:], rotation.conjugate(tip[3:])))
            if (angle := sqrt(lag.dot(lag))) > _MOST_LAG:
                self.goal[3:] = rotation.product(rotation.exp(lag * (_MOST_LAG / angle)), tip[3:])
                self.engage(hand, self.goal.copy(), to_base, scale)
        return pursue(self._chain, command, self.goal[:3], self.goal[3:], largest_move)
