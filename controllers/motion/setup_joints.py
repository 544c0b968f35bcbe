"""The setup joints of the cart for clients: braked, with positions and an operating state.

On the real system (jhu-dvrk/sawIntuitiveResearchKit, mtsIntuitiveResearchKitSUJ.cpp) a single controller
drives all brakes, so all setup joints have the same operating state, and potentiometers know the positions
from the start: the joints are homed. Only the dVRK's simulation lets clients set positions.
"""

from __future__ import annotations

from typing import Any, cast

from controllers.motion.frames import setup_positions
from controllers.motion.messages import Messages
from controllers.motion.operating_state import Repeats, State, refusal
from controllers.motion.params import MotionParams
from controllers.motion.ports import setup_joint_event_names
from hub.participant import Inputs, Record, choice, flag, number
from robots.dvrk import crtk, setup_joints
from robots.transform import matrix_to_pose
from schemas.crtk import StringStamped
from schemas.vectors import Vector

__all__ = ["SetupJoints"]

_BRAKED = "the setup joints are braked; `setup_joints` of the scenario sets their positions"


class SetupJointState(Record):
    """The common operating state of all setup joints."""

    state = choice(State.DISABLED)
    homed = flag(start=True)
    powering = number()
    """Time until the setup joints are ENABLED, s; 0: not powering."""
    published = flag()
    """Whether clients know the state."""


class SetupJoints:
    """The setup joints of all driven arms; without a cart there are none."""

    def __init__(self, params: MotionParams, outputs: dict[str, Any]) -> None:
        """`outputs`: the controller's outputs, setup joints included."""
        arms = tuple(params.arms.present_arms) if params.mounting == "cart" else ()
        self._power_time = params.power_time * 1e-9
        self._messages = {arm: Messages(f"SUJ/{arm}", setup_joint_event_names(), outputs) for arm in arms}
        self._commands = {f"SUJ/{arm}/{name}" for arm in arms for name in crtk.SETUP_JOINT_COMMANDS}
        self._now = SetupJointState()
        if params.initial_state == "homed":
            self._now.state = State.ENABLED
        self._repeats = Repeats()
        self._rests = False
        """Whether a step without commands changes nothing."""
        self.state: tuple[Record | Vector, ...] = ()
        if arms:
            self.state = (
                self._now,
                self._repeats.state,
                *(messages.state for messages in self._messages.values()),
            )
        for arm in arms:
            positions = setup_positions(arm, params)
            outputs |= {
                f"SUJ/{arm}/measured_js": positions,
                f"SUJ/{arm}/local/measured_cp": matrix_to_pose(setup_joints.base_pose(arm, positions)),
            }

    def step(self, t: int, h: int, inputs: Inputs) -> None:
        """Execute arrived commands, from `t` to `t + h` (ns)."""
        if self._rests and inputs.event_ports.isdisjoint(self._commands):
            return
        news = not self._now.published
        for arm, messages in self._messages.items():
            messages.begin(t + h)
            if inputs.quiet:
                continue
            for message in inputs.events(f"SUJ/{arm}/state_command"):
                news |= self._command(messages, cast("StringStamped", message))
            for name in crtk.SETUP_JOINT_COMMANDS:
                if name != "state_command" and inputs.events(f"SUJ/{arm}/{name}"):
                    messages.refuse(name, _BRAKED, ready=False)
        if news | self._power(h * 1e-9):
            self._now.published = True
            for messages in self._messages.values():
                messages.operating_state(
                    self._now.state, homed=self._now.homed, busy=self._now.powering > 0.0
                )
        self._rests = not self._now.powering and all(messages.quiet for messages in self._messages.values())

    def recompute_derived(self) -> None:
        """Note a restored state."""
        self._rests = False

    def _command(self, messages: Messages, message: StringStamped) -> bool:
        """Execute a `state_command`; return whether the command was accepted."""
        state, command = self._now.state, message.string
        reason = refusal(state, command) or (
            "the setup joints do not pause" if command == "pause" else self._repeats.refusal(message)
        )
        if reason:
            messages.warning(reason)
            return False
        if command in ("enable", "home") and state is State.DISABLED and not self._now.powering:
            self._now.powering = max(self._power_time, 1e-9)
        elif command == "disable":
            self._now.state, self._now.powering = State.DISABLED, 0.0
        if command in ("home", "unhome"):
            self._now.homed = command == "home"
        messages.status(f"state_command {command}")
        return True

    def _power(self, h: float) -> bool:
        """Continue powering, for `h` seconds; return whether powering is done."""
        if not self._now.powering:
            return False
        self._now.powering = max(self._now.powering - h, 0.0)
        if self._now.powering < 0.5 * h:  # whole steps, in spite of rounding
            self._now.state, self._now.powering = State.ENABLED, 0.0
        return not self._now.powering
