"""An arm's way through its operating states: powering, homing, pausing, faults."""

from __future__ import annotations

import numpy as np

from controllers.motion.axes import Mode
from controllers.motion.drives import Drives
from controllers.motion.limits import GOAL_TOLERANCE, HOMING_TIMEOUT, TRACKING_TOLERANCE
from controllers.motion.messages import Messages
from controllers.motion.operating_state import Desired, Repeats, State, refusal
from schemas.crtk import StringStamped
from schemas.vectors import Vector

__all__ = ["Lifecycle"]


_DESIRED = {"enable": Desired.ENABLED, "disable": Desired.DISABLED, "home": Desired.HOMED}
"""What commands ask for; a pause leaves it to be resumed."""
_FULL = np.ones(2)
"""Shares of velocity and acceleration with which an arm homes."""


class Lifecycle:
    """The operating state of one arm, and what its change does to the drives."""

    def __init__(
        self, drives: Drives, messages: Messages, home: Vector, power_time: float, *, homed: bool
    ) -> None:
        """Take the drives, where to tell what happens, home, shape (n,), the time (s) to power, and whether
        to start homed.
        """
        self._drives, self._messages = drives, messages
        self._home, self._power_time = home, power_time
        n = len(home)
        self._tolerance = np.array([*TRACKING_TOLERANCE, *TRACKING_TOLERANCE[-1:] * n][:n])
        self.flags = np.zeros(6)
        self._state, self._homed, self._powering, self._homing, self._late, self._desired = np.split(
            self.flags, 6
        )
        self._repeats = Repeats()
        self.arrays = (self.flags, self._repeats.state)
        """All that changes."""
        self._commands = {
            "enable": self._enable,
            "disable": self._disable,
            "home": self._go_home,
            "unhome": self._unhome,
            "pause": self._pause,
            "resume": self._resume,
        }
        if homed:
            self._state[0], self._homed[0], self._desired[0] = State.ENABLED, 1.0, Desired.HOMED
            drives.power(on=True)

    @property
    def state(self) -> State:
        """The operating state."""
        return State(int(self._state[0]))

    @property
    def is_homed(self) -> bool:
        """Whether the arm knows where it is and may move."""
        return bool(self._homed[0])

    @property
    def is_busy(self) -> bool:
        """Whether the arm powers, homes or moves."""
        return (
            bool(self._powering[0] or (self._homing[0] and self.state is not State.PAUSED))
            or self._drives.is_moving
        )

    @property
    def desired_state(self) -> str:
        """Where the arm was told to go: CRTK's `desired_state`."""
        return (
            self.state.name
            if self.state in (State.PAUSED, State.FAULT)
            else Desired(int(self._desired[0])).name
        )

    def not_ready(self) -> str:
        """Return why the arm takes no motion commands; empty if it does."""
        if self.state is not State.ENABLED:
            return (
                f"the arm is {self.state.name}{' and powering' if self._powering[0] else ''}, allowed in"
                " ENABLED and homed"
            )
        if self._homing[0]:
            return "the arm is homing, allowed when it is homed"
        return "" if self._homed[0] else "the arm is not homed, send state_command home first"

    def command(self, message: StringStamped) -> bool:
        """Heed a `state_command`; return whether the state takes it."""
        if reason := refusal(self.state, message.string) or self._repeats.refusal(message):
            self._messages.warning(reason)
            return False
        if message.string in _DESIRED:
            self._desired[0] = _DESIRED[message.string]
        self._commands[message.string]()
        if message.string != "unhome":
            self._messages.desired_state(self.desired_state)
        self._messages.status(f"state_command {message.string}")
        return True

    def watch(self, h: float) -> None:
        """Notice what has ended or gone wrong in the last step, of `h` seconds."""
        if self._drives.joints.mode is Mode.POSITION and (reason := self._lost()):
            self._fault(reason)
        self._drives.tell_arrivals(silent=bool(self._homing[0]))
        if self._homing[0] and self.state is State.ENABLED and not self._drives.joints.is_moving:
            self._check_home(h)

    def step(self, h: float) -> None:
        """Go on with powering, for `h` seconds."""
        if not self._powering[0]:
            return
        self._powering[0] = max(self._powering[0] - h, 0.0)
        if self._powering[0] < 0.5 * h:  # whole steps, whatever rounding leaves
            self._finish_powering()

    def _enable(self) -> None:
        if self.state is State.DISABLED and not self._powering[0]:
            self._powering[0] = self._power_time
            if not self._power_time:
                self._finish_powering()

    def _go_home(self) -> None:
        """Home unless that is done or under way, powering first if need be."""
        if self._homed[0] or self._homing[0]:
            self._enable()
            return
        self._homing[0], self._late[0] = 1.0, 0.0
        if self.state is State.ENABLED:
            self._drives.move(self._drives.joints, self._home, _FULL)
        else:
            self._enable()

    def _disable(self) -> None:
        self._switch_off(State.DISABLED)

    def _unhome(self) -> None:
        if self.state is State.ENABLED:
            self._drives.rest()
        self._homed[0] = self._homing[0] = 0.0

    def _pause(self) -> None:
        self._drives.rest()
        self._state[0] = State.PAUSED

    def _resume(self) -> None:
        self._state[0] = State.ENABLED
        if self._homing[0]:
            self._drives.move(self._drives.joints, self._home, _FULL)

    def _finish_powering(self) -> None:
        self._powering[0], self._state[0] = 0.0, State.ENABLED
        self._drives.power(on=True)
        self._messages.status("enabled")
        if self._homing[0]:
            self._drives.move(self._drives.joints, self._home, _FULL)

    def _switch_off(self, state: State) -> None:
        self._powering[0] = self._homing[0] = 0.0
        self._state[0] = state
        self._drives.power(on=False)

    def _fault(self, reason: str) -> None:
        self._messages.error(f"FAULT: {reason}; send state_command disable, then enable")
        self._switch_off(State.FAULT)
        self._messages.desired_state(self.desired_state)

    def _lost(self) -> str:
        """Return which joints are further from their setpoint than they may be; empty if none is."""
        joints = self._drives.joints
        away = np.abs(joints.setpoint.position - joints.position)
        if not (away > self._tolerance).any():
            return ""
        rows = zip(joints.chain.joints, away.tolist(), self._tolerance.tolist(), strict=True)
        return "tracking error, " + "; ".join(
            f"joint {joint.name} is {distance:.3g} {joint.unit} from its setpoint, allowed are {most:g}"
            for joint, distance, most in rows
            if distance > most
        )

    def _check_home(self, h: float) -> None:
        away = float(np.abs(self._home - self._drives.joints.position).max())
        if away <= GOAL_TOLERANCE:
            self._homing[0], self._homed[0] = 0.0, 1.0
            self._messages.status("homed")
            return
        self._late[0] += h
        if self._late[0] > HOMING_TIMEOUT:
            self._fault(
                f"home not reached {HOMING_TIMEOUT:g} s after its trajectory, {away:.3g} (rad, m) away,"
                f" allowed are {GOAL_TOLERANCE:.3g}"
            )
