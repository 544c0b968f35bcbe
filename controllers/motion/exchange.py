"""Exchange of an arm's instrument, as an assistant and the robot do it together.

The arm straightens the wrist, draws the instrument back into the cannula and waits. The assistant takes the
instrument out and puts another in. The arm then advances the new one, straight, to a little less than the
depth of the last tip, as the da Vinci's guided tool change does. The arm takes no other command meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from math import radians

import numpy as np

from controllers.motion.drives import Drives
from controllers.motion.messages import Messages
from controllers.motion.params import PsmParams
from hub.participant import Record, choice, integer, number
from robots.dvrk.psm import JOINT_NAMES
from robots.limits import distinct
from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["Exchange"]

_INSERTION, _WRIST = JOINT_NAMES.index("insertion"), slice(JOINT_NAMES.index("wrist_pitch"), None)
_SHORT_M = 5e-3
"""Distance of the new tip from the depth of the last one, towards the cannula; assumed."""
_OPEN = radians(2.0)
"""Largest opening of a jaw beyond its setpoint at which nothing is between the fingers; assumed."""
_ARRIVED = 1e-9
"""rad and m."""


class Phase(IntEnum):
    """Phase of an exchange."""

    NONE = 0
    WITHDRAW = 1
    OUT = 2
    ADVANCE = 3


class ExchangeState(Record):
    """The instrument, and the progress of an exchange."""

    held = integer()
    """Number of the instrument in the arm: 0 the mounted one, 1 the first spare."""
    next = integer()
    """Number of the instrument to come."""
    phase = choice(Phase.NONE)
    left = number()
    """Time until the next instrument is in the arm, s."""
    depth = number()
    """Depth of the last tip from the remote centre, m."""
    ready = integer()
    """Number of the instrument as in `held`, -1 during an exchange."""


class Exchange:
    """Gives an arm another of its instruments."""

    def __init__(
        self,
        variants: Sequence[PsmParams],
        drives: Drives,
        messages: Messages,
        seconds: float,
        ready: Callable[[], str],
        fit: Callable[[], None],
    ) -> None:
        """Start with the first of `variants`.

        Args:
            variants: the arm with each of its instruments.
            drives: drives of the arm.
            messages: events of the arm.
            seconds: time that the assistant needs.
            ready: returns why the arm refuses motion commands; empty: accepted.
            fit: called for the arm to take over the kinematics of the instrument held.
        """
        self._variants, self._drives, self._messages = variants, drives, messages
        self._seconds, self._ready, self._fit = seconds, ready, fit
        self.state = ExchangeState()

    @property
    def held(self) -> PsmParams:
        """The arm with the present instrument."""
        return self._variants[self.state.held]

    @property
    def is_busy(self) -> bool:
        """Whether an exchange is under way."""
        return self.state.phase is not Phase.NONE

    def not_ready(self) -> str:
        """Return why the arm refuses motion commands; empty: accepted."""
        if not self.is_busy:
            return ""
        return (
            f"the arm exchanges its instrument for {self._variants[self.state.next].tool.name}, wait for that"
        )

    def refusal(self, command: str) -> str:
        """Return why the arm refuses a motion command; empty: accepted."""
        if command.startswith("jaw/") and not self._drives.has_gripper:
            return f"the arm holds {self.held.tool.name}, which has no jaw"
        return self.not_ready()

    def begin(self, number: int) -> None:
        """Begin to give the arm an instrument.

        Raises MotionError while the arm is not ready, or the jaw presses on something.
        """
        if reason := self.not_ready() or self._ready():
            raise MotionError(reason)
        self._check_jaw()
        position = self._drives.joints.position
        tip = self.held.chain.forward(position)[:3, 3]
        self.state.depth = float(tip @ _along(self.held, position))
        self.state.next = number
        self._enter(Phase.WITHDRAW)
        self._withdraw()
        name = self._variants[number].tool.name
        self._messages.status(f"exchange of {self.held.tool.name} for {name}: drawing back")

    def stop(self) -> None:
        """Forget an exchange, unless the arm is empty: the arm is off or not homed any more."""
        if self.state.phase in (Phase.WITHDRAW, Phase.ADVANCE):
            self._enter(Phase.NONE)
            self._messages.warning(f"exchange ended on the way: the arm holds {self.held.tool.name}")

    def step(self, h: float) -> None:
        """Go on, for `h` seconds, with the drives on."""
        if self.state.phase is Phase.OUT:
            self.state.left = max(self.state.left - h, 0.0)
            if self.state.left < 0.5 * h:  # whole steps, in spite of rounding
                self._engage()
            return
        setpoint = self._drives.joints.setpoint
        if setpoint.is_moving:
            return
        if self.state.phase is Phase.WITHDRAW:
            if np.abs(setpoint.position - self._drawn_back).max() > _ARRIVED:  # after a pause
                self._withdraw()
            else:
                self._enter(Phase.OUT)
                self.state.left = self._seconds
                self._messages.status(f"{self.held.tool.name} taken out")
        elif self.state.phase is Phase.ADVANCE:
            if np.abs(setpoint.position - self._advanced).max() > _ARRIVED:
                self._advance()
            else:
                self._enter(Phase.NONE)
                self._messages.status(f"exchange done: the arm holds {self.held.tool.name}")

    def _engage(self) -> None:
        self.state.held = self.state.next
        self._enter(Phase.ADVANCE)
        self._fit()
        if (jaw := self._drives.gripper) is not None:
            jaw.power(on=self._drives.has_gripper)
        self._advance()

    def _enter(self, phase: Phase) -> None:
        self.state.phase = phase
        self.state.ready = -1 if self.is_busy else self.state.held

    def _check_jaw(self) -> None:
        """Raise MotionError if something keeps the jaw open, as the robot can tell."""
        jaw = self._drives.gripper
        if jaw is None or not self.held.end_effector.joints:
            return
        opening = float((jaw.position - jaw.setpoint.position)[0])
        if opening > _OPEN:
            value, most = distinct(opening, _OPEN, digits=3)
            raise MotionError(
                f"something keeps the jaw {value} rad open, allowed are {most}: open the jaw first"
            )

    def _withdraw(self) -> None:
        self._drives.move(self._drives.joints, self._drawn_back, np.ones(2))

    def _advance(self) -> None:
        self._drives.move(self._drives.joints, self._advanced, np.ones(2))

    @property
    def _drawn_back(self) -> Vector:
        """Positions of the joints with the tip in the cannula and the wrist straight, shape (n,)."""
        goal = self._drives.joints.setpoint.position.copy()
        goal[_WRIST] = 0.0
        goal[_INSERTION] = self.held.chain.lower[_INSERTION]
        return goal

    @property
    def _advanced(self) -> Vector:
        """Positions of the joints with the tip near the depth of the last one, shape (n,)."""
        goal, chain = self._drawn_back, self.held.chain
        along = _along(self.held, goal)
        short = self.state.depth - _SHORT_M - float(chain.forward(goal)[:3, 3] @ along)
        goal[_INSERTION] = np.clip(goal[_INSERTION] + short, chain.lower[_INSERTION], chain.upper[_INSERTION])
        return goal


def _along(arm: PsmParams, position: Vector) -> Vector:
    """Return the direction in which the instrument goes in, in the base frame, shape (3,)."""
    deeper = position.copy()
    deeper[_INSERTION] += 1.0
    return arm.chain.forward(deeper)[:3, 3] - arm.chain.forward(position)[:3, 3]
