"""One arm under CRTK's commands: what it receives and publishes, step by step."""

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
from controllers.motion.lifecycle import Lifecycle
from controllers.motion.messages import Messages
from controllers.motion.params import MotionParams
from controllers.motion.ports import EQUIPMENT_COMMANDS, event_names
from controllers.motion.telemetry import KnownWeight, Telemetry
from hub.participant import Inputs, Record, flag
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


class ArmState(Record):
    """Whether the arm has made a step."""

    started = flag()


class Arm:
    """One arm. All that changes is in `state`."""

    def __init__(
        self, name: CartArm, params: MotionParams, camera: Callable[[], Vector | None], period: float
    ) -> None:
        """Build the arm as the scenario states it.

        Args:
            name: its name.
            params: parameters of the controller.
            camera: returns the pose of the ECM's tip in the world, shape (4, 4), if there is an ECM.
            period: the controller's step, s.
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
        self._cartesian = CartesianCommands(
            name, self._drives, self._base, self._commands.settings.ratio, period
        )
        self._lifecycle = Lifecycle(
            self._drives,
            self._messages,
            np.array(arm.home),
            params.power_time * 1e-9,
            homed=params.initial_state == "homed",
        )
        handlers = {**self._equipment.handlers, **self._commands.handlers, **self._cartesian.handlers}
        self._state_port = f"{name}/state_command"
        commands = (*crtk.COMMANDS, *self._equipment.handlers)
        self._ports = [
            (command, f"{name}/{command}", handlers[command])
            for command in commands
            if command != "state_command"
        ]
        self._prefixes = [name]
        if (gripper := arm.gripper) is not None:
            self._prefixes.append(f"{name}/{gripper.name}")
            grasping = [
                (f"{gripper.name}/{command}", handlers[f"gripper/{command}"])
                for command in crtk.GRIPPER_COMMANDS
            ]
            self._ports += [(command, f"{name}/{command}", handler) for command, handler in grasping]
        self._now, self._modes = ArmState(), np.array(self._drives.modes, np.float64)
        self.state = (
            self._now,
            self._commands.settings,
            *self._base.state,
            *self._lifecycle.records,
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
        """Read what is measured; the setpoint starts from there."""
        for port, axes in self._sensed:
            axes.measured[:] = inputs[port]
            if not self._now.started:
                axes.setpoint.reset(axes.position)

    def step(self, t: int, h: int, inputs: Inputs) -> None:
        """Execute the commands that have arrived, and advance from `t` to `t + h` (ns)."""
        self._messages.begin(t + h)
        before = self._condition() if self._now.started else None
        if before is None:
            self._now.started = True
            self._messages.desired_state(self._lifecycle.desired_state)
            self._equipment.publish()
        self._lifecycle.watch(self._period)
        awaited = self._execute(inputs)
        self._lifecycle.step(self._period)
        self._drives.step(self._period)
        if awaited or self._condition() != before:
            state, homed, busy = self._condition()
            self._messages.operating_state(state, homed=homed, busy=busy)
        self._update_modes()

    def publish(self) -> None:
        """Update the states that are not published at every step."""
        drives, commands = self._drives, self._commands
        joints = drives.joints
        self._telemetry.update(
            joints.measured, joints.commanded, self._base.pose, absolute=drives.control.absolute
        )
        carries = joints.mode is not Mode.OFF and commands.settings.gravity_compensation
        self._telemetry.update_settings(
            commands.settings.ratio, carries * self._weight.effort(joints.position)
        )
        if drives.gripper is not None:
            self._gripper_setpoint[:] = drives.gripper.commanded

    def restored(self) -> None:
        """Compute what follows from `state` after it was restored."""
        for axes in self._drives.groups:
            axes.setpoint.restored()
        self._update_modes()

    def _update_modes(self) -> None:
        self._modes[:] = self._drives.modes
        if self._modes[0] and not self._commands.settings.gravity_compensation:
            self._modes[0] += _BARE

    def _condition(self) -> tuple[Any, bool, bool]:
        return self._lifecycle.state, self._lifecycle.is_homed, self._lifecycle.is_busy

    def _execute(self, inputs: Inputs) -> bool:
        """Execute what has arrived; return whether clients now wait for the operating state."""
        if inputs.quiet:  # nearly always, and an arm has 35 ports
            return False
        awaited = False
        for message in inputs.events(self._state_port):
            awaited |= self._lifecycle.command(cast("StringStamped", message))
        for command, port, handler in self._ports:
            for message in inputs.events(port):
                self._execute_one(command, handler, message)
                awaited |= crtk.is_move(command)
        return awaited

    def _execute_one(self, command: str, handler: Callable[[Any], None], message: Message) -> None:
        if reason := self._not_ready(command):
            self._messages.refuse(command, reason, ready=False)
            return
        try:
            handler(message)
        except MotionError as error:
            self._messages.refuse(command, str(error), ready=True)
            if crtk.is_move(command) and not self._drives.is_moving:
                # as the real controller does; a move that is under way continues
                self._messages.goal_reached(reached=False)
            return
        self._messages.executed(command)
        if command in crtk.CARTESIAN_COMMANDS:
            self._drives.control.cartesian = True

    def _not_ready(self, command: str) -> str:
        """Return why the arm refuses `command` now; empty if it does not."""
        if command in _ANY_TIME:
            return ""
        return self._lifecycle.not_ready() or (
            self._cartesian.not_ready() if command in crtk.CARTESIAN_COMMANDS else ""
        )
