"""One arm under CRTK's commands: what arrives, what is told, step by step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from controllers.motion.axes import Mode
from controllers.motion.cartesian_commands import CartesianCommands
from controllers.motion.commands import Commands
from controllers.motion.drives import Drives
from controllers.motion.equipment import Equipment
from controllers.motion.frames import BaseFrame, base_in_world
from controllers.motion.gravity import KnownWeight
from controllers.motion.lifecycle import Lifecycle
from controllers.motion.messages import Messages
from controllers.motion.params import MotionParams
from controllers.motion.ports import EQUIPMENT_COMMANDS, event_names
from controllers.motion.telemetry import Telemetry
from hub.participant import Inputs
from robots.dvrk import crtk
from robots.dvrk.setup_joints import CartArm
from schemas.crtk import StringStamped
from schemas.errors import MotionError
from schemas.message import Message
from schemas.vectors import Vector

__all__ = ["Arm"]

_ANY_TIME = crtk.SETTINGS.union(*EQUIPMENT_COMMANDS.values())
"""Commands that are executed in every operating state."""
_BARE = 2.0
"""What `control_mode` adds to position and effort without gravity compensation."""


class Arm:
    """One arm. All that changes is in the arrays of `state`."""

    def __init__(
        self, name: CartArm, params: MotionParams, camera: Callable[[], Vector | None], period: float
    ) -> None:
        """Take the arm's name, what the scenario says, what returns the ECM's tip in the world, shape (4, 4),
        and the step (s).
        """
        arm = params.arms.driven[name]
        self._name, self._period = name, period
        held = arm.equipment
        self._messages = Messages(name, event_names(arm))
        self._equipment = Equipment(*held, self._messages)
        self._base = BaseFrame(name, params, camera)
        self._drives = Drives(arm, self._messages, lambda: self._base.pose)
        self._telemetry = Telemetry(name, arm.chain)
        self._weight = KnownWeight(name, arm.chain, base_in_world(name, params))
        self._commands = Commands(self._drives, period)
        self._cartesian = CartesianCommands(name, self._drives, self._base, self._commands.ratio, period)
        self._lifecycle = Lifecycle(
            self._drives,
            self._messages,
            np.array(arm.home),
            params.power_time * 1e-9,
            homed=params.initial_state == "homed",
        )
        heeding = {**self._equipment.handlers, **self._commands.handlers, **self._cartesian.handlers}
        self._state_port = f"{name}/state_command"
        commands = (*crtk.COMMANDS, *self._equipment.handlers)
        self._ports = [
            (command, f"{name}/{command}", heeding[command])
            for command in commands
            if command != "state_command"
        ]
        self._prefixes = [name]
        if (gripper := arm.gripper) is not None:
            self._prefixes.append(f"{name}/{gripper.name}")
            grasping = [
                (f"{gripper.name}/{command}", heeding[f"gripper/{command}"])
                for command in crtk.GRIPPER_COMMANDS
            ]
            self._ports += [(command, f"{name}/{command}", heed) for command, heed in grasping]
        self._started, self._modes = np.zeros(1), np.array(self._drives.modes, np.float64)
        self.state = (
            self._started,
            *self._commands.state,
            *self._base.state,
            *self._lifecycle.arrays,
            self._messages.state,
            *self._drives.state,
        )
        self._sensed = [
            (f"sense/{prefix}/measured_js", axes)
            for prefix, axes in zip(self._prefixes, self._drives.groups, strict=True)
        ]
        self._gripper_setpoint = np.zeros(0) if gripper is None else np.zeros(3 * len(gripper.joints))
        self.events = self._messages.outputs
        """Event outputs of the last step."""

    @property
    def outputs(self) -> dict[str, Any]:
        """All outputs; the arrays stay the same ones."""
        outputs: dict[str, Any] = {
            **self.events,
            **self._telemetry.outputs,
            f"drive/{self._name}/control_mode": self._modes,
        }
        for prefix, axes in zip(self._prefixes, self._drives.groups, strict=True):
            outputs |= {
                f"drive/{prefix}/servo_jp": axes.setpoint.position,
                f"drive/{prefix}/servo_jf": axes.effort,
            }
        if self._drives.gripper is not None:
            prefix = self._prefixes[1]
            outputs |= {
                f"{prefix}/measured_js": self._drives.gripper.measured,
                f"{prefix}/setpoint_js": self._gripper_setpoint,
            }
        return outputs

    @property
    def tip(self) -> Vector:
        """Pose of the tip as measured, in the arm's base frame, shape (4, 4)."""
        return self._drives.joints.chain.forward(self._drives.joints.position)

    def sense(self, inputs: Inputs) -> None:
        """Take what is measured; the first time the setpoint starts from there."""
        for port, axes in self._sensed:
            axes.measured[:] = inputs[port]
            if not self._started[0]:
                axes.setpoint.reset(axes.position)

    def step(self, t: int, h: int, inputs: Inputs) -> None:
        """Heed the commands that have arrived, and advance from `t` to `t + h` (ns)."""
        self._messages.begin(t + h)
        before = self._condition() if self._started[0] else None
        if before is None:
            self._started[0] = 1.0
            self._messages.desired_state(self._lifecycle.desired_state)
            self._equipment.tell()
        self._lifecycle.watch(self._period)
        heeded = self._heed(inputs)
        self._lifecycle.step(self._period)
        self._drives.step(self._period)
        if heeded or self._condition() != before:
            state, homed, busy = self._condition()
            self._messages.operating_state(state, homed=homed, busy=busy)
        self._tell_modes()

    def publish(self) -> None:
        """Bring the states that are not published at every step up to date."""
        drives, commands = self._drives, self._commands
        joints = drives.joints
        self._telemetry.update(
            joints.measured, joints.commanded, self._base.pose, absolute=bool(drives.absolute[0])
        )
        bears = joints.mode is not Mode.OFF and bool(commands.gravity_compensation[0])
        self._telemetry.tell_settings(commands.ratio, bears * self._weight.effort(joints.position))
        if drives.gripper is not None:
            self._gripper_setpoint[:] = drives.gripper.commanded

    def restored(self) -> None:
        """Bring what is not in `state` up to it."""
        for axes in self._drives.groups:
            axes.setpoint.restored()
        self._tell_modes()

    def _tell_modes(self) -> None:
        self._modes[:] = self._drives.modes
        if self._modes[0] and not self._commands.gravity_compensation[0]:
            self._modes[0] += _BARE

    def _condition(self) -> tuple[Any, bool, bool]:
        return self._lifecycle.state, self._lifecycle.is_homed, self._lifecycle.is_busy

    def _heed(self, inputs: Inputs) -> bool:
        """Carry out what has arrived; return whether there was a command after which clients wait for the
        operating state.
        """
        if inputs.quiet:  # nearly always, and an arm has 35 ports
            return False
        awaited = False
        for message in inputs.events(self._state_port):
            awaited |= self._lifecycle.command(cast("StringStamped", message))
        for command, port, heed in self._ports:
            for message in inputs.events(port):
                self._heed_one(command, heed, message)
                awaited |= crtk.is_move(command)
        return awaited

    def _heed_one(self, command: str, heed: Callable[[Any], None], message: Message) -> None:
        if reason := self._not_ready(command):
            self._messages.refuse(command, reason, ready=False)
            return
        try:
            heed(message)
        except MotionError as error:
            self._messages.refuse(command, str(error), ready=True)
            if crtk.is_move(command) and not self._drives.is_moving:
                # as the real controller does; a move under way goes on
                self._messages.goal_reached(reached=False)
            return
        self._messages.heeded(command)
        if command in crtk.CARTESIAN_COMMANDS:
            self._drives.cartesian[0] = 1.0

    def _not_ready(self, command: str) -> str:
        """Return why the arm does not take `command` now; empty if it does."""
        if command in _ANY_TIME:
            return ""
        return self._lifecycle.not_ready() or (
            self._cartesian.not_ready() if command in crtk.CARTESIAN_COMMANDS else ""
        )
