"""The pose law: the tip follows translation (scaled) and rotation of the hand, relative to a reference.

As on the real dVRK (jhu-dvrk/sawIntuitiveResearchKit, mtsTeleOperationPSM.cpp, RunEnabled), with x and H
position and orientation of the hand in the hand's base frame, p and P of the tip in the arm's base frame, R
the orientation of the hand's base in the arm's, s the scale, and 0 for the reference:

    p = p0 + s R (x - x0),    P = R H A0  with  A0 = (R H0)' P0.

A reference is taken from hand and command whenever the hand takes over, and from the *last* hand and goal
when scale or view change during leading: so no change moves the tip, and no motion of the hand is lost. A
reference is also taken while the tip, at a limit of its joints, is turned too far away from the goal: past
half a turn the nearest rotation is the opposite.
"""

from __future__ import annotations

from math import radians, sqrt
from operator import mul

import numpy as np

from hub.participant import Record, array, number
from robots import rotation
from robots.inverse_kinematics import LastFrames, pursue
from robots.serial_chain import SerialChain
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["PoseLaw"]

_MOST_LAG = radians(90.0)
"""Largest lag of the tip's orientation behind the goal: half of the angle of reversal; ours."""
_LITTLE_LAG = 0.75
"""Cosine of half an angle well below the largest lag."""


class PoseLawState(Record):
    """The goal and the reference; poses are (x, y, z, qx, qy, qz, qw)."""

    goal = array(7)
    """Goal of the tip, in the arm's base frame."""
    hand_reference = array(7)
    tip_reference = array(7)
    hand = array(7)
    """Newest pose of the hand, in the hand's base frame."""
    to_base = array(4)
    """Orientation of the hand's base frame in the arm's."""
    scale = number()


class PoseLaw:
    """From poses of the hand to joint positions."""

    def __init__(self, chain: SerialChain, *, turns: bool, frames: LastFrames | None = None) -> None:
        """`turns`: the tip turns with the hand, otherwise keeps its orientation.

        `frames`: frames of the command, if shared with other readers.
        """
        self._chain, self._turns, self._frames = chain, turns, frames or LastFrames(chain)
        self.state = PoseLawState()
        self.goal, self._hand, self._to_base = self.state.goal, self.state.hand, self.state.to_base
        self._hand0, self._tip0 = self.state.hand_reference, self.state.tip_reference
        self.goal[6] = self._to_base[3] = 1.0
        self._found: tuple[bytes, ...] = ()
        """Bits of the reference of the next two values."""
        self._turn_to_base, self._offset = np.eye(3), np.zeros(4)

    def engage(self, hand: Vector, tip: Vector, to_base: Vector, scale: float) -> None:
        """Take the reference: the hand at `hand` is the tip at `tip`, both (x, y, z, qx, qy, qz, qw).

        Args:
            hand: pose in the hand's base frame.
            tip: pose at the command, in the arm's base frame.
            to_base: orientation of the hand's base frame in the arm's, quaternion.
            scale: metres of the tip per metre of the hand.
        """
        self._hand0[:] = self._hand[:] = hand
        self._tip0[:] = self.goal[:] = tip
        self._to_base[:], self.state.scale = to_base, scale

    def step(
        self, command: Vector, hand: Vector, tip: Vector, to_base: Vector, scale: float, largest_move: Vector
    ) -> Vector:
        """Return the joint positions, shape (n,), after `command` with the hand at `hand`.

        Arguments as of `engage` and `robots.inverse_kinematics.pursue`.
        """
        seen = to_base.tobytes()
        if scale != self.state.scale or (
            seen != self._to_base.tobytes() and (to_base != self._to_base).any()
        ):
            self.engage(self._hand.copy(), self.goal.copy(), to_base, scale)
        self._hand[:] = hand
        self._find_offset(to_base, seen)
        goal = self.goal
        goal[:3] = self._tip0[:3] + scale * self._turn_to_base.dot(hand[:3] - self._hand0[:3])
        if self._turns:
            turned = rotation.product(rotation.product(to_base, hand[3:]), self._offset)
            goal[3:] = turned / sqrt(turned.dot(turned))
            # of an angle below 83 degrees, whose half has a cosine above 0.75, nothing more is to be known
            if not abs(plain_sum(map(mul, goal[3:].tolist(), tip[3:].tolist()))) > _LITTLE_LAG:
                self._limit_lag(hand, tip, to_base, scale)
        return pursue(self._chain, command, goal[:3], goal[3:], largest_move, self._frames)

    def _find_offset(self, to_base: Vector, seen: bytes) -> None:
        """Compute the values derived from the reference, unless the reference's bits are unchanged.

        `seen`: bits of `to_base`, different from the bits in the state by a sign of zero at most.
        """
        reference = seen, self._to_base.tobytes(), self._hand0.tobytes(), self._tip0.tobytes()
        if reference == self._found:
            return
        self._found, self._turn_to_base = reference, rotation.matrix(self._to_base)
        hand0 = rotation.product(to_base, self._hand0[3:])
        self._offset = rotation.product(rotation.conjugate(hand0), self._tip0[3:])

    def _limit_lag(self, hand: Vector, tip: Vector, to_base: Vector, scale: float) -> None:
        """Bring the goal's orientation back near to the tip's, as a new reference."""
        lag = rotation.log(rotation.product(self.goal[3:], rotation.conjugate(tip[3:])))
        if (angle := sqrt(lag.dot(lag))) > _MOST_LAG:
            self.goal[3:] = rotation.product(rotation.exp(lag * (_MOST_LAG / angle)), tip[3:])
            self.engage(hand, self.goal.copy(), to_base, scale)
