"""The setup joints of the cart as clients see them: where they are, and an operating state. They are braked:
nothing moves them.

On the real system (jhu-dvrk/sawIntuitiveResearchKit, mtsIntuitiveResearchKitSUJ.cpp) one controller drives
the brakes of all of them, so that they share their operating state, and its potentiometers know the positions
from the start: they are homed. Only its simulation lets clients set positions.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from controllers.motion.frames import pose, setup_positions
from controllers.motion.messages import Messages
from controllers.motion.operating_state import Repeats, State, refusal
from controllers.motion.params import MotionParams
from controllers.motion.ports import setup_joint_event_names
from hub.participant import Inputs
from robots.dvrk import crtk, setup_joints
from schemas.crtk import StringStamped

__all__ = ["SetupJoints"]

_BRAKED = "the setup joints are braked; `setup_joints` of the scenario says where they are"


class SetupJoints:
    """The setup joints of all driven arms."""

    def __init__(self, params: MotionParams) -> None:
        """Take what the scenario says; without a cart there are none."""
        arms = tuple(params.arms.driven) if params.mounting == "cart" else ()
        self._power_time = params.power_time * 1e-9
        self._said = {arm: Messages(f"SUJ/{arm}", setup_joint_event_names()) for arm in arms}
        self._flags = np.array(
            [State.ENABLED if params.initial_state == "homed" else State.DISABLED, 1.0, 0.0, 0.0]
        )
        self._state, self._homed, self._powering, self._told = np.split(self._flags, 4)
        self._repeats = Repeats()
        self.state = (
            (self._flags, self._repeats.state, *(said.state for said in self._said.values())) if arms else ()
        )
        """All that changes."""
        self.outputs: dict[str, Any] = {}
        for arm in arms:
            positions = setup_positions(arm, params)
            self.outputs |= {
                f"SUJ/{arm}/measured_js": positions,
                f"SUJ/{arm}/local/measured_cp": pose(setup_joints.base_pose(arm, positions)),
            }
            self.outputs |= self._said[arm].outputs

    def step(self, t: int, h: int, inputs: Inputs) -> None:
        """Heed what has arrived, from `t` to `t + h` (ns)."""
        news = not self._told[0]
        for arm, said in self._said.items():
            said.begin(t + h)
            if inputs.quiet:
                continue
            for message in inputs.events(f"SUJ/{arm}/state_command"):
                news |= self._command(said, cast("StringStamped", message))
            for name in crtk.SETUP_JOINT_COMMANDS:
                if name != "state_command" and inputs.events(f"SUJ/{arm}/{name}"):
                    said.refuse(name, _BRAKED, ready=False)
        if news | self._power(h * 1e-9):
            self._told[0] = 1.0
            for said in self._said.values():
                said.operating_state(
                    State(int(self._state[0])), homed=bool(self._homed[0]), busy=bool(self._powering[0])
                )
        for said in self._said.values():
            self.outputs |= said.outputs

    def _command(self, said: Messages, message: StringStamped) -> bool:
        """Heed a `state_command`; return whether it was."""
        state, command = State(int(self._state[0])), message.string
        reason = refusal(state, command) or (
            "the setup joints do not pause" if command == "pause" else self._repeats.refusal(message)
        )
        if reason:
            said.warning(reason)
            return False
        if command in ("enable", "home") and state is State.DISABLED and not self._powering[0]:
            self._powering[0] = max(self._power_time, 1e-9)
        elif command == "disable":
            self._state[0], self._powering[0] = State.DISABLED, 0.0
        if command in ("home", "unhome"):
            self._homed[0] = command == "home"
        said.status(f"state_command {command}")
        return True

    def _power(self, h: float) -> bool:
        """Go on with powering, for `h` seconds; return whether it is done."""
        if not self._powering[0]:
            return False
        self._powering[0] = max(self._powering[0] - h, 0.0)
        if self._powering[0] < 0.5 * h:  # whole steps, whatever rounding leaves
            self._state[0], self._powering[0] = State.ENABLED, 0.0
        return not self._powering[0]
