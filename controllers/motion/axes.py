"""Joints driven together, an arm's or a gripper's: measured state and commands to the drives."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from controllers.motion.setpoint import Setpoint
from controllers.motion.setpoint_state import Activity
from hub.participant import Record, array, choice, flag
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["Axes", "Mode"]


class Mode(IntEnum):
    """Mode of the drives, with the numbers of `control_mode`."""

    OFF = 0
    POSITION = 1
    EFFORT = 2


class AxesState(Record):
    """State of n joints beside the setpoint."""

    measured = array(3, "n")
    """Positions, velocities and efforts."""
    effort = array("n")
    """Commanded effort."""
    mode = choice(Mode.OFF)
    moving = flag()
    """Whether a commanded move is not reported as ended by `pop_finished` yet."""


class Axes:
    """n joints with their setpoint.

    While the drives do not hold a position, the setpoint is where the joints are.
    """

    def __init__(self, chain: SerialChain, start: Vector) -> None:
        """`start`: positions at time 0, shape (n,)."""
        n = len(chain.joints)
        self.chain, self.setpoint = chain, Setpoint(chain.joints)
        self._state = AxesState(n=n)
        self.measured, self.effort = self._state.measured.reshape(3 * n), self._state.effort
        self.position = self.measured[:n]
        """Measured positions, shape (n,)."""
        self.position[:] = start
        self.setpoint.reset(start)
        self.state = (self._state, self.setpoint.state)

    def fit(self, chain: SerialChain) -> None:
        """Take over the kinematics and limits of an instrument with joints of the same names."""
        self.chain = chain
        self.setpoint.limit(chain.joints)

    @property
    def mode(self) -> Mode:
        """Present mode of the drives."""
        return self._state.mode

    @property
    def is_moving(self) -> bool:
        """Whether a commanded move is not reported as ended by `pop_finished` yet."""
        return self._state.moving

    @property
    def commanded(self) -> Vector:
        """Positions, velocities and efforts as commanded, shape (3 n,)."""
        return np.concatenate([self.setpoint.position, self.setpoint.velocity, self.effort])

    @property
    def newest_goal(self) -> Vector:
        """Start of relative commands, shape (n,): the goal if any, else the setpoint."""
        under_way = self.setpoint.activity is Activity.FOLLOW or self.setpoint.is_moving
        return self.setpoint.goal if under_way else self.setpoint.position

    def pop_finished(self) -> bool:
        """Return once, a step after the arrival, that the move has arrived: every move takes a step."""
        arrived = self.is_moving and not self.setpoint.is_moving
        if arrived:
            self._state.moving = False
        return arrived

    def follow(self, goal: Vector, h: float, velocity: Vector | None = None) -> None:
        """Follow a goal inside the ranges; arguments as of `Setpoint.follow`."""
        self._hold_position()
        self._state.moving = False
        self.setpoint.follow(goal, h, velocity)

    def drift(self, velocity: Vector) -> None:
        """Move with `velocity`, shape (n,), as long as the velocity is sent again."""
        self._hold_position()
        self._state.moving = False
        self.setpoint.drift(velocity)

    def move(self, goal: Vector, ratio: Vector) -> None:
        """Move to `goal`, shape (n,), inside the ranges.

        `ratio`, shape (2,): fractions of velocity and acceleration for the move.
        """
        self._hold_position()
        self._state.moving = True
        self.setpoint.move(goal, ratio)

    def hold(self) -> None:
        """Brake and stay."""
        self._hold_position()
        self._state.moving = False
        self.setpoint.brake()

    def apply(self, effort: Vector) -> None:
        """Apply efforts, shape (n,), at whatever position the joints are."""
        self._state.mode, self._state.moving = Mode.EFFORT, False
        self.effort[:] = effort
        self.setpoint.reset(self.position)

    def power(self, *, on: bool) -> None:
        """Switch the drives off, or on to hold the joints in place."""
        self._state.mode, self._state.moving = Mode.POSITION if on else Mode.OFF, False
        self.effort[:] = 0.0
        self.setpoint.reset(self.position)

    @property
    def is_following(self) -> bool:
        """Whether the setpoint follows a stream of goals."""
        return self._state.mode is Mode.POSITION and self.setpoint.activity is Activity.FOLLOW

    def step(self, h: float) -> None:
        """Advance the setpoint by `h` seconds."""
        if self._state.mode is Mode.POSITION:
            self.setpoint.step(h)
        else:
            self.setpoint.reset(self.position)

    def _hold_position(self) -> None:
        if self._state.mode is not Mode.POSITION:
            self.power(on=True)
