"""The operating state of an arm: powering, homing, pausing, faults.

Source of the tolerances: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68).
"""

from __future__ import annotations

from math import radians

import numpy as np

from controllers.motion.axes import Mode
from controllers.motion.drives import Drives
from controllers.motion.messages import Messages
from controllers.motion.operating_state import Desired, Repeats, State, refusal
from hub.participant import Record, choice, flag, number
from robots.limits import distinct
from robots.serial_chain import Joint
from schemas.crtk import StringStamped
from schemas.vectors import Vector

__all__ = ["Lifecycle"]

_TRACKING_TOLERANCE = (0.5, 0.5, 0.05, 0.6, 0.6, 0.6)
"""Largest distance of a joint from the setpoint, rad and m, before the arm goes to FAULT.

From SAW share/pid/sawControllersPID-PSM.json; the first four are used for the ECM too.
"""
_MASTER_TOLERANCE = (0.2, 0.2, 0.2, 0.2, 0.5, 0.5, 0.5)
"""The same of a master, rad (SAW share/pid/sawControllersPID-MTM.json)."""
_GOAL_TOLERANCE = radians(3.0)
"""Largest distance of a joint from home, rad and m, after homing.

From SAW mtsIntuitiveResearchKit{PSM,ECM}.cpp.
"""
_HOMING_TIMEOUT = 2.0
"""Time from the end of the homing trajectory for the arm to be at home, s.

From SAW mtsIntuitiveResearchKitArm.cpp, RunHoming.
"""

_DESIRED = {"enable": Desired.ENABLED, "disable": Desired.DISABLED, "home": Desired.HOMED}
"""States requested by commands; after a pause the arm goes on with the request."""
_FULL = np.ones(2)
"""Fractions of velocity and acceleration for homing."""


class LifecycleState(Record):
    """The operating state of an arm, and the progress to the next state."""

    state = choice(State.DISABLED)
    homed = flag()
    powering = number()
    """Time until the arm is ENABLED, s; 0: not powering."""
    homing = flag()
    late = number()
    """s since the end of the homing trajectory."""
    desired = choice(Desired.DISABLED)


class Lifecycle:
    """The operating state of an arm, and the effect of changes on the drives."""

    def __init__(
        self, drives: Drives, messages: Messages, home: Vector, power_time: float, *, homed: bool
    ) -> None:
        """Start DISABLED, or ENABLED and homed.

        Args:
            drives: drives of the arm.
            messages: events of the arm.
            home: joint positions, shape (n,).
            power_time: time from `enable` to ENABLED, s.
            homed: whether to start ENABLED and homed.
        """
        self._drives, self._messages = drives, messages
        self._home, self._power_time = home, power_time
        n = len(home)
        self._tolerance = (
            list(_MASTER_TOLERANCE)
            if n == len(_MASTER_TOLERANCE)
            else [*_TRACKING_TOLERANCE, *_TRACKING_TOLERANCE[-1:] * n][:n]
        )
        self._now = LifecycleState()
        self._repeats = Repeats()
        self.records = (self._now, self._repeats.state)
        self._commands = {
            "enable": self._enable_arm,
            "disable": self._disable_arm,
            "home": self._go_home,
            "unhome": self._forget_home,
            "pause": self._pause_motion,
            "resume": self._resume_motion,
        }
        if homed:
            self._now.state, self._now.homed, self._now.desired = State.ENABLED, True, Desired.HOMED
            drives.power(on=True)

    @property
    def state(self) -> State:
        """The operating state."""
        return self._now.state

    @property
    def condition(self) -> tuple[State, bool, bool]:
        """The operating state, whether the arm is homed, and whether powering, homing or moving."""
        now, state = self._now, self._now.state
        busy = now.powering > 0.0 or (now.homing and state is not State.PAUSED) or self._drives.is_moving
        return state, now.homed, busy

    @property
    def desired_state(self) -> str:
        """The commanded state: CRTK's `desired_state`."""
        return self.state.name if self.state in (State.PAUSED, State.FAULT) else self._now.desired.name

    @property
    def is_lost(self) -> bool:
        """Whether the drives hold a position and a joint is too far from its setpoint."""
        joints = self._drives.joints
        if joints.mode is not Mode.POSITION:
            return False
        goals, positions = joints.setpoint.position.tolist(), joints.position.tolist()
        for goal, position, most in zip(goals, positions, self._tolerance, strict=True):
            if abs(goal - position) > most:
                return True
        return False

    def not_ready(self) -> str:
        """Return why the arm refuses motion commands; empty: accepted."""
        if self.state is not State.ENABLED:
            return (
                f"the arm is {self.state.name}{' and powering' if self._now.powering else ''}, allowed in"
                " ENABLED and homed"
            )
        if self._now.homing:
            return "the arm is homing, allowed when it is homed"
        return "" if self._now.homed else "the arm is not homed, send state_command home first"

    def command(self, message: StringStamped) -> bool:
        """Execute a `state_command`; return whether the command was accepted."""
        if reason := refusal(self.state, message.string) or self._repeats.refusal(message):
            self._messages.warning(reason)
            return False
        if message.string in _DESIRED:
            self._now.desired = _DESIRED[message.string]
        self._commands[message.string]()
        if message.string != "unhome":
            self._messages.desired_state(self.desired_state)
        self._messages.status(f"state_command {message.string}")
        return True

    def watch(self, h: float) -> None:
        """Check for ends and failures in the last step, of `h` seconds."""
        if self.is_lost:
            self._enter_fault(self._loss())
        self._drives.report_arrivals(silent=self._now.homing)
        if self._now.homing and self.state is State.ENABLED and not self._drives.joints.is_moving:
            self._check_home(h)

    def step(self, h: float) -> None:
        """Continue powering, for `h` seconds."""
        if not self._now.powering:
            return
        self._now.powering = max(self._now.powering - h, 0.0)
        if self._now.powering < 0.5 * h:  # whole steps, in spite of rounding
            self._finish_powering()

    def _enable_arm(self) -> None:
        if self.state is State.DISABLED and not self._now.powering:
            self._now.powering = self._power_time
            if not self._power_time:
                self._finish_powering()

    def _go_home(self) -> None:
        """Home the arm unless homed or homing; power a DISABLED arm first."""
        if self._now.homed or self._now.homing:
            self._enable_arm()
            return
        self._now.homing, self._now.late = True, 0.0
        if self.state is State.ENABLED:
            self._drives.move(self._drives.joints, self._home, _FULL)
        else:
            self._enable_arm()

    def _disable_arm(self) -> None:
        self._switch_off(State.DISABLED)

    def _forget_home(self) -> None:
        if self.state is State.ENABLED:
            self._drives.rest()
        self._now.homed = self._now.homing = False

    def _pause_motion(self) -> None:
        self._drives.rest()
        self._now.state = State.PAUSED

    def _resume_motion(self) -> None:
        self._now.state = State.ENABLED
        if self._now.homing:
            self._drives.move(self._drives.joints, self._home, _FULL)

    def _finish_powering(self) -> None:
        self._now.powering, self._now.state = 0.0, State.ENABLED
        self._drives.power(on=True)
        self._messages.status("enabled")
        if self._now.homing:
            self._drives.move(self._drives.joints, self._home, _FULL)

    def _switch_off(self, state: State) -> None:
        self._now.powering, self._now.homing = 0.0, False
        self._now.state = state
        self._drives.power(on=False)

    def _enter_fault(self, reason: str) -> None:
        self._messages.error(f"FAULT: {reason}; send state_command disable, then enable")
        self._switch_off(State.FAULT)
        self._messages.desired_state(self.desired_state)

    def _loss(self) -> str:
        """Return the joints too far from their setpoint."""
        joints = self._drives.joints
        away = np.abs(joints.setpoint.position - joints.position)
        rows = zip(joints.chain.joints, away.tolist(), self._tolerance, strict=True)
        return "tracking error, " + "; ".join(
            _astray_sentence(joint, distance, most) for joint, distance, most in rows if distance > most
        )

    def _check_home(self, h: float) -> None:
        away = float(np.abs(self._home - self._drives.joints.position).max())
        if away <= _GOAL_TOLERANCE:
            self._now.homing, self._now.homed = False, True
            self._messages.status("homed")
            return
        self._now.late += h
        if self._now.late > _HOMING_TIMEOUT:
            distance, allowed = distinct(away, _GOAL_TOLERANCE, digits=3)
            self._enter_fault(
                f"home not reached {_HOMING_TIMEOUT:g} s after its trajectory, {distance} (rad, m) away,"
                f" allowed are {allowed}"
            )


def _astray_sentence(joint: Joint, distance: float, most: float) -> str:
    away, allowed = distinct(distance, most, digits=3)
    return f"joint {joint.name} is {away} {joint.unit} from its setpoint, allowed are {allowed}"
