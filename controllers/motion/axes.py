"""Joints that are driven together, an arm's or its gripper's: what is measured of them, and what their drives
are told.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from controllers.motion.setpoint import Activity, Setpoint
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["Axes", "Mode"]


class Mode(IntEnum):
    """What the drives do; the numbers are those of `control_mode`."""

    OFF = 0
    POSITION = 1
    EFFORT = 2


class Axes:
    """n joints with their setpoint.

    While the drives do not hold a position, the setpoint is where the joints are.
    """

    def __init__(self, chain: SerialChain, start: Vector) -> None:
        """Take the joints, and their positions at time 0, shape (n,)."""
        n = len(chain.joints)
        self.chain, self.setpoint = chain, Setpoint(chain.joints)
        self._state = np.zeros(4 * n + 2)
        self.measured, self.effort = self._state[: 3 * n], self._state[3 * n : 4 * n]
        self._mode, self._moving = self._state[4 * n : 4 * n + 1], self._state[4 * n + 1 :]
        self.position = self.measured[:n]
        """As measured, shape (n,)."""
        self.position[:] = start
        self.setpoint.reset(start)
        self.state = (self._state, self.setpoint.state)

    @property
    def mode(self) -> Mode:
        """What the drives do."""
        return Mode(int(self._mode[0]))

    @property
    def is_moving(self) -> bool:
        """Whether a move has been asked for whose end nobody has noticed yet (`finished`)."""
        return bool(self._moving[0])

    @property
    def commanded(self) -> Vector:
        """Positions, velocities and efforts as commanded, shape (3 n,)."""
        return np.concatenate([self.setpoint.position, self.setpoint.velocity, self.effort])

    @property
    def newest_goal(self) -> Vector:
        """What relative commands start from, shape (n,): the goal that is followed or moved to, else the
        setpoint.
        """
        under_way = self.setpoint.activity is Activity.FOLLOW or self.setpoint.is_moving
        return self.setpoint.goal if under_way else self.setpoint.position

    def finished(self) -> bool:
        """Say, once, that the move has arrived: a step later, so that even a move to where the joints are
        takes a step.
        """
        arrived = self.is_moving and not self.setpoint.is_moving
        if arrived:
            self._moving[0] = 0.0
        return arrived

    def follow(self, goal: Vector, h: float, velocity: Vector | None = None) -> None:
        """Follow `goal`, shape (n,), inside the ranges, with the velocity that the sender states, if any."""
        self._hold_position()
        self._moving[0] = 0.0
        self.setpoint.follow(goal, h, velocity)

    def drift(self, velocity: Vector) -> None:
        """Go on with `velocity`, shape (n,), for as long as it is told again."""
        self._hold_position()
        self._moving[0] = 0.0
        self.setpoint.drift(velocity)

    def move(self, goal: Vector, ratio: Vector) -> None:
        """Move to `goal`, shape (n,), inside the ranges, at the shares `ratio`, shape (2,), of velocity and
        acceleration.
        """
        self._hold_position()
        self._moving[0] = 1.0
        self.setpoint.move(goal, ratio)

    def hold(self) -> None:
        """Brake and stay."""
        self._hold_position()
        self._moving[0] = 0.0
        self.setpoint.brake()

    def apply(self, effort: Vector) -> None:
        """Apply efforts, shape (n,), and leave the positions to themselves."""
        self._mode[0], self._moving[0] = Mode.EFFORT, 0.0
        self.effort[:] = effort
        self.setpoint.reset(self.position)

    def power(self, *, on: bool) -> None:
        """Switch the drives off, or on to hold the joints where they are."""
        self._mode[0], self._moving[0] = (Mode.POSITION if on else Mode.OFF), 0.0
        self.effort[:] = 0.0
        self.setpoint.reset(self.position)

    def step(self, h: float) -> None:
        """Advance the setpoint by `h` seconds."""
        if self._mode[0] == Mode.POSITION:
            self.setpoint.step(h)
        else:
            self.setpoint.reset(self.position)

    def _hold_position(self) -> None:
        if self._mode[0] != Mode.POSITION:
            self.power(on=True)
