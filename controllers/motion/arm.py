"""An arm under CRTK's commands: commands in and states out, step by step."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, cast

import numpy as np

from controllers.motion.axes import Axes, Mode
from controllers.motion.cartesian_commands import CartesianCommands
from controllers.motion.commands import Commands
from controllers.motion.drives import Drives, WrenchFrame
from controllers.motion.equipment import Equipment
from controllers.motion.exchange import Exchange
from controllers.motion.frames import BaseFrame, base_in_world
from controllers.motion.lifecycle import Lifecycle
from controllers.motion.master import MasterGripper, OrientationLock
from controllers.motion.messages import Messages
from controllers.motion.operating_state import State
from controllers.motion.params import (
    AnyParams,
    EcmParams,
    Gripper,
    MotionParams,
    MtmlParams,
    MtmrParams,
    PsmParams,
)
from controllers.motion.ports import EQUIPMENT_COMMANDS, MASTER_COMMANDS, event_names
from controllers.motion.setpoint import Setpoint
from controllers.motion.telemetry import KnownWeight, TelemetryRow
from hub.participant import Inputs, Record, flag
from robots.dvrk import crtk
from robots.dvrk.setup_joints import DrivenArm
from robots.serial_chain import SerialChain
from schemas.crtk import StringStamped
from schemas.errors import MotionError
from schemas.message import Message
from schemas.vectors import Vector

__all__ = ["Arm"]

_ANY_TIME = crtk.SETTINGS.union(MASTER_COMMANDS, *EQUIPMENT_COMMANDS.values())
"""Commands executed in every operating state."""
_LOCKED = 5.0
"""`control_mode` of a master that holds its orientation beside a wrench; 6 without gravity compensation."""
_BARE = 2.0
"""Addition to `control_mode`, position or effort, without gravity compensation."""

_Commanded = tuple[int, str, Callable[[Any], None] | None]
"""Order, name and handler of a command; None: a command of the operating state."""


class ArmState(Record):
    """Whether the arm has made a step."""

    started = flag()


class Arm:
    """An arm. All variables are in `state`."""

    def __init__(
        self,
        name: DrivenArm,
        params: MotionParams,
        camera: Callable[[], Vector | None],
        period: float,
        outputs: dict[str, Any],
    ) -> None:
        """Build the arm of the scenario.

        Args:
            name: name of the arm.
            params: parameters of the controller.
            camera: as for `BaseFrame`.
            period: the controller's step, s.
            outputs: the controller's outputs; the arm adds its own, with arrays kept for the whole session.
        """
        arm = params.arms.driven_arms[name]
        self._period = period
        self._messages = Messages(name, event_names(arm), outputs)
        self._base = BaseFrame(name, params, camera)
        self._drives = Drives(arm, self._messages, lambda: self._base.pose)
        self.weight = KnownWeight(name, arm.chain, base_in_world(name, params))
        """Weight carried by the real controller."""
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
        self._exchange = self._exchange_of(arm, params.exchange_time)
        self.refitted = False
        """Whether kinematics have changed; reset by the controller."""
        self._equipment: Equipment | None = None
        if isinstance(arm, PsmParams | EcmParams):
            names = [one.equipment[1] for one in arm.variants]
            self._equipment = Equipment(arm.equipment[0], names, self._messages, self._exchange)
        self._lock: OrientationLock | None = None
        self._held_gripper: MasterGripper | None = None
        if isinstance(arm, MtmlParams | MtmrParams):
            self._lock = OrientationLock(arm.chain, self._base, lambda: self.position, self._messages)
            self._held_gripper = MasterGripper(name, arm.end_effector_start[0], self._messages)
        self._commanded = self._commands_by_port(name, arm.gripper)
        self._now, self._modes = ArmState(), np.array(self._drives.modes, np.float64)
        self._condition: tuple[State, bool, bool] | None = None
        """Condition of `Lifecycle` after the last step; None: before the first step."""
        self._rests = False
        """Whether a step without commands changes nothing but the setpoint, with the joints at the setpoint.
        """
        self.state = (
            self._now,
            self._commands.settings,
            *self._base.state,
            *self._lifecycle.records,
            self._messages.state,
            *self._drives.state,
            *(() if self._exchange is None else (self._exchange.state,)),
            *(() if self._lock is None else (self._lock.state,)),
            *(() if self._held_gripper is None else (self._held_gripper.state,)),
        )
        if self._exchange is not None:
            outputs[f"drive/{name}/instrument"] = self._exchange.state.part("held")
            outputs[f"{name}/instrument"] = self._exchange.state.part("ready")
        prefixes = [name] if arm.gripper is None else [name, f"{name}/{arm.gripper.name}"]
        groups = dict(zip(prefixes, self._drives.groups, strict=True))
        self._sensed = [(f"sense/{prefix}/measured_js", axes) for prefix, axes in groups.items()]
        self._offsets = params.joint_errors.of(name, len(arm.chain.joints))
        self._is_off = bool(self._offsets.any())
        self._driven = self._drives.joints.setpoint.position
        if self._is_off or self._lock is not None:
            self._driven = self._driven.copy()
        self._gripper_setpoint = np.zeros(0 if arm.gripper is None else 3 * len(arm.gripper.joints))
        outputs[f"drive/{name}/control_mode"] = self._modes
        outputs |= self._joint_outputs(groups)
        if self._held_gripper is not None:
            outputs[f"{name}/gripper/measured_js"] = self._held_gripper.measured

    def _exchange_of(self, arm: AnyParams, time_ns: int) -> Exchange | None:
        if not isinstance(arm, PsmParams) or len(arm.variants) == 1:
            return None
        drives, messages = self._drives, self._messages
        return Exchange(arm.variants, drives, messages, time_ns * 1e-9, self._lifecycle.not_ready, self._fit)

    def _fit(self) -> None:
        """Take over the instrument that the arm holds now."""
        if self._exchange is not None:
            self._drives.fit(self._exchange.held)
            self._cartesian.fit()
            self.refitted = True

    def _commands_by_port(self, name: DrivenArm, gripper: Gripper | None) -> dict[str, _Commanded]:
        """Return order, name and handler of each command, by port."""
        own = self._own_handlers
        handlers = {**own, **self._commands.handlers, **self._cartesian.handlers}
        commands = [(command, handlers.get(command)) for command in (*crtk.COMMANDS, *own)]
        if gripper is not None:
            commands += [
                (f"{gripper.name}/{word}", handlers[f"gripper/{word}"]) for word in crtk.GRIPPER_COMMANDS
            ]
        return {
            f"{name}/{command}": (order, command, handler)
            for order, (command, handler) in enumerate(commands)
        }

    @property
    def _own_handlers(self) -> Mapping[str, Callable[[Any], None]]:
        """Handlers of the commands of this kind of arm alone."""
        if self._equipment is not None:
            return self._equipment.handlers
        return {} if self._lock is None else self._lock.handlers

    def _joint_outputs(self, groups: Mapping[str, Axes]) -> Iterator[tuple[str, Vector]]:
        """Yield the outputs of joints driven together, by the prefix of the ports."""
        for prefix, axes in groups.items():
            is_arm = axes is self._drives.joints
            yield f"drive/{prefix}/servo_jp", self._driven if is_arm else axes.setpoint.position
            yield f"drive/{prefix}/servo_jf", axes.effort
            if not is_arm:
                yield f"{prefix}/measured_js", axes.measured
                yield f"{prefix}/setpoint_js", self._gripper_setpoint

    @property
    def chain(self) -> SerialChain:
        """Kinematics of the arm."""
        return self._drives.joints.chain

    @property
    def position(self) -> Vector:
        """Of the joints as measured, shape (n,)."""
        return self._drives.joints.position

    def sense(self, inputs: Inputs) -> None:
        """Read measurements, the start of the setpoint."""
        for port, axes in self._sensed:
            axes.measured[:] = inputs[port]
        if self._held_gripper is not None:
            self._held_gripper.sense(inputs)
        if self._is_off:
            self._drives.joints.position -= self._offsets
        if not self._now.started:
            for axes in self._drives.groups:
                axes.setpoint.reset(axes.position)

    def step(self, t: int, h: int, inputs: Inputs) -> list[Setpoint]:
        """Execute arrived commands, and advance from `t` to `t + h` (ns).

        Returned are the setpoints following a stream, to follow together with the setpoints of all arms.
        """
        self._messages.begin(t + h)
        if self._held_gripper is not None:
            self._held_gripper.step(self._period)
        arrived = () if inputs.quiet else inputs.event_ports & self._commanded.keys()
        if self._rests and not arrived and not self._lifecycle.is_lost:
            return self._drives.step(self._period)
        before = self._condition
        if before is None:
            self._now.started = True
            self._messages.desired_state(self._lifecycle.desired_state)
            if self._equipment is not None:
                self._equipment.publish()
        self._lifecycle.watch(self._period)
        awaited = self._execute_arrived(inputs, arrived)
        self._lifecycle.step(self._period)
        self._step_exchange()
        following = self._drives.step(self._period)
        state, homed, busy = self._condition = self._present_condition
        if awaited or self._condition != before:
            self._messages.operating_state(state, homed=homed, busy=busy)
        self._update_modes()
        self._rests = not busy
        return following

    @property
    def _present_condition(self) -> tuple[State, bool, bool]:
        """State, whether the arm is homed, and whether a motion or an exchange is under way."""
        state, homed, busy = self._lifecycle.condition
        return state, homed, busy or (self._exchange is not None and self._exchange.is_busy)

    def _step_exchange(self) -> None:
        """Go on with an exchange, if one is under way."""
        if self._exchange is None or not self._exchange.is_busy:
            return
        state, homed, _ = self._lifecycle.condition
        if state is State.ENABLED and homed:
            held = self._exchange.held
            self._exchange.step(self._period)
            if self._exchange.held is not held and self._equipment is not None:
                self._equipment.publish()
        elif state is not State.PAUSED:
            self._exchange.stop()

    def drive(self) -> None:
        """Command the final setpoints of the step, through encoders with offsets."""
        if self._lock is not None:
            self._driven[:] = (
                self._lock.goal() if self._holds_orientation else self._drives.joints.setpoint.position
            )
        elif self._is_off:
            np.add(self._drives.joints.setpoint.position, self._offsets, out=self._driven)

    def publish(self, row: TelemetryRow) -> None:
        """Write to `row` the input of the states not published at every step."""
        drives, settings = self._drives, self._commands.settings
        joints = drives.joints
        row.setpoint[0], row.setpoint[1] = joints.setpoint.position, joints.setpoint.velocity
        row.setpoint[2], row.measured[:] = joints.effort, joints.measured
        row.base[:], row.ratio[:] = self._base.pose, settings.ratio
        row.switches[0] = drives.control.absolute
        row.switches[1] = joints.mode is not Mode.OFF and settings.gravity_compensation
        if self._held_gripper is not None:
            self._held_gripper.publish()
        if drives.gripper is not None:
            self._gripper_setpoint[:] = drives.gripper.commanded

    def recompute_derived(self) -> None:
        """Recompute all values derived from `state` after a restore."""
        self._fit()
        for axes in self._drives.groups:
            axes.setpoint.recompute_derived()
        self._condition = self._present_condition if self._now.started else None
        self._update_modes()
        self._rests = False
        self.drive()

    def _update_modes(self) -> None:
        self._modes[:] = self._drives.modes
        if self._holds_orientation:
            self._modes[0] = _LOCKED if self._commands.settings.gravity_compensation else _LOCKED + 1.0
        elif self._modes[0] and not self._commands.settings.gravity_compensation:
            self._modes[0] += _BARE

    @property
    def _holds_orientation(self) -> bool:
        """Whether the drives of the wrist hold a locked orientation, beside a wrench."""
        drives = self._drives
        presses = drives.joints.mode is Mode.EFFORT and drives.control.frame is not WrenchFrame.NONE
        return self._lock is not None and self._lock.is_locked and presses

    def _execute_arrived(self, inputs: Inputs, ports: Collection[str]) -> bool:
        """Execute commands from `ports`; return whether clients now wait for the operating state."""
        awaited = False
        for port in sorted(ports, key=self._order):
            _, command, handler = self._commanded[port]
            for message in inputs.events(port):
                if handler is None:
                    awaited |= self._lifecycle.command(cast("StringStamped", message))
                else:
                    self._execute_one(command, handler, message)
                    awaited |= crtk.is_move(command)
        return awaited

    def _order(self, port: str) -> int:
        return self._commanded[port][0]

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
        self._messages.note_executed(command)
        if command in crtk.CARTESIAN_COMMANDS:
            self._drives.control.cartesian = True

    def _not_ready(self, command: str) -> str:
        """Return why the arm refuses `command` now; empty: accepted."""
        if command in _ANY_TIME:
            return ""
        if self._exchange is not None and (reason := self._exchange.refusal(command)):
            return reason
        return self._lifecycle.not_ready() or (
            self._cartesian.not_ready() if command in crtk.CARTESIAN_COMMANDS else ""
        )
