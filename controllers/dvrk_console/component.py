"""A teleoperation component of the dVRK: a master, the arm led by it, and the state of the pair.

The states are those of mtsTeleOperationPSM.cpp (jhu-dvrk/sawIntuitiveResearchKit): DISABLED;
SETTING_ARMS_STATE until master and arm are enabled and homed; ALIGNING_MTM until the master is turned like
the tip and held by a hand; ENABLED, where the arm follows unless the clutch is pressed. The `teleoperation`
knows the poses of both and decides when the hand takes over; the component only permits.
"""

from __future__ import annotations

from collections.abc import Set
from enum import IntEnum
from typing import cast

import numpy as np

from controllers.dvrk_console.master import Master, opening, orientation_offset
from controllers.dvrk_console.params import DvrkConsoleParams
from controllers.dvrk_console.ports import EventOutputs
from controllers.dvrk_console.readiness import Readiness
from controllers.teleoperation.engagement import EngagementPhase
from hub.participant import Inputs, Record, choice, flag, integer, number
from robots.limits import TOLERANCE, distinct
from schemas.crtk import StringStamped
from schemas.errors import did_you_mean
from schemas.message import Message
from schemas.ros import BoolMessage, Float64Message, Header, Joy, QuaternionStamped, StringMessage, Time

__all__ = ["Component", "Published", "TeleopState"]

_ALIGN_NS = 10_000_000
"""Time from a command to turn to the next command (RunAligningMTM)."""


class TeleopState(IntEnum):
    """Of a component."""

    DISABLED = 0
    SETTING_ARMS_STATE = 1
    ALIGNING_MTM = 2
    ENABLED = 3


class Published(IntEnum):
    """Last published value of a condition."""

    NOTHING = -1
    FALSE = 0
    TRUE = 1


_COMMANDS = {
    "enable": TeleopState.ENABLED,
    "disable": TeleopState.DISABLED,
    "align_mtm": TeleopState.ALIGNING_MTM,
}


class ComponentState(Record):
    """Everything in a component that lasts from step to step."""

    desired = choice(TeleopState.DISABLED)
    requested = choice(TeleopState.DISABLED)
    """Last request of the console; `desired` follows only when the request changes."""
    current = choice(TeleopState.DISABLED)
    phase = choice(EngagementPhase.DISABLED)
    """Last published phase of the `teleoperation`."""
    following = flag()
    leads = choice(Published.NOTHING)
    """Whether the hand may lead."""
    selected = flag()
    scale = number()
    gripper = number(-1.0)
    align = flag()
    """Whether the master is turned by motors."""
    rotation_locked = flag()
    translation_locked = flag()
    aligned_ns = integer()
    """When the master was commanded to turn, ns."""


class Component:
    """A component, such as `MTMR_PSM1`."""

    def __init__(self, name: str, params: DvrkConsoleParams, events: EventOutputs) -> None:
        """Create a disabled component; `events`: the outputs."""
        self.name, self._events = name, events
        self.master, self.arm = name.split("_")
        self._commands = Master(self.master, events)
        self.state = ComponentState()
        self.state.align, self.state.scale = params.align_mtm, params.scale

    def publish_all(self) -> None:
        """Publish everything, at the start."""
        self._publish_state()
        self._publish("desired_state", StringMessage(data=self.state.desired.name))
        self._publish("following", BoolMessage(data=False))
        self._publish("scale", Float64Message(data=self.state.scale))
        for name, is_set in (
            ("align_mtm", self.state.align),
            ("rotation_locked", self.state.rotation_locked),
            ("translation_locked", self.state.translation_locked),
        ):
            self._publish(name, BoolMessage(data=is_set))

    def set_scale(self, scale: float) -> None:
        """Set the scale, above 0 and up to 1."""
        self.state.scale = scale
        self._publish("scale", Float64Message(data=scale))

    def step(
        self, now_ns: int, inputs: Inputs, requested: TeleopState, readiness: Readiness, *, clutched: bool
    ) -> None:
        """Go towards the desired state, by a step that ends at `now_ns`.

        Args:
            now_ns: simulated time, ns.
            inputs: inputs of the console.
            requested: requested state of the console; a request counts when it changes.
            readiness: readiness of arms and masters.
            clutched: whether the clutch is pressed.
        """
        state = self.state
        if not inputs.quiet:
            self._receive(inputs)
        if requested is not state.requested:
            state.requested = requested
            self._set_desired(requested)
        state.gripper = opening(float(inputs[f"{self.master}/gripper/measured_js"][0]))
        if lost := readiness.lost & {self.master, self.arm}:
            self._disable_following(lost)
        before, followed = state.current, state.following
        state.current = self._next(readiness, clutched=clutched)
        self._permit_following(
            leads=state.desired is TeleopState.ENABLED
            and state.current >= TeleopState.ALIGNING_MTM
            and not clutched
        )
        state.following = (
            state.current is TeleopState.ENABLED and state.phase is EngagementPhase.ENABLED and not clutched
        )
        if before is not state.current:
            self._enter()
        if state.current is TeleopState.SETTING_ARMS_STATE:
            self._set_arms(
                readiness, {self.arm, self.master} if before is not state.current else readiness.new
            )
        if followed is not state.following:
            self._publish("following", BoolMessage(data=state.following))
        floats = followed is not state.following and state.current is TeleopState.ENABLED
        self._command_master(inputs, now_ns, floats=floats, clutched=clutched)

    def _receive(self, inputs: Inputs) -> None:
        """Read the messages of programs and of the teleoperation."""
        state = self.state
        for command in cast("tuple[StringStamped, ...]", inputs.events(f"{self.name}/state_command")):
            if command.string in _COMMANDS:
                self._set_desired(_COMMANDS[command.string])
            else:
                self.warn(
                    f"there is no state_command '{command.string}'.{did_you_mean(command.string, _COMMANDS)}"
                )
        for scale in cast("tuple[Float64Message, ...]", inputs.events(f"{self.name}/set_scale")):
            if 0.0 < scale.data <= 1.0 + TOLERANCE:
                self.set_scale(min(scale.data, 1.0))
            else:
                value = distinct(scale.data, 0.0, 1.0)[0]
                self.warn(
                    f"scale {value} is refused, allowed is above 0 and up to 1; it stays {state.scale:g}"
                )
        for lock in self._bool_messages(inputs, "lock_rotation"):
            state.rotation_locked = lock.data
            self._publish_lock("rotation", lock)
        for lock in self._bool_messages(inputs, "lock_translation"):
            state.translation_locked = lock.data
            self._publish_lock("translation", lock)
        for align in self._bool_messages(inputs, "set_align_MTM"):
            state.align = align.data
            self._publish("align_mtm", align)
        for phase in cast("tuple[StringMessage, ...]", inputs.events(f"teleop/{self.name}/state")):
            state.phase = EngagementPhase[phase.data]
        for message in cast("tuple[StringMessage, ...]", inputs.events(f"teleop/{self.name}/warning")):
            self._publish("warning", message)

    def _bool_messages(self, inputs: Inputs, name: str) -> tuple[BoolMessage, ...]:
        return cast("tuple[BoolMessage, ...]", inputs.events(f"{self.name}/{name}"))

    def _publish_lock(self, what: str, lock: BoolMessage) -> None:
        self._publish(f"{what}_locked", lock)
        self._events.publish(f"teleop/{self.name}/lock_{what}", lock)

    def _set_desired(self, state: TeleopState) -> None:
        self.state.desired = state
        self._publish("desired_state", StringMessage(data=state.name))

    def _disable_following(self, lost: Set[str]) -> None:
        """Stop when an arm is no longer ready.

        Only a command starts the component again, as on the real system.
        """
        if self.state.current >= TeleopState.ALIGNING_MTM:
            self.warn(
                f"{' and '.join(sorted(lost))} not ENABLED and homed any more; send state_command enable"
            )
            self._set_desired(TeleopState.DISABLED)

    def _next(self, readiness: Readiness, *, clutched: bool) -> TeleopState:
        state = self.state
        if state.desired is TeleopState.DISABLED:
            return TeleopState.DISABLED
        if not (readiness.is_ready(self.arm) and readiness.may_lead(self.master)):
            return TeleopState.SETTING_ARMS_STATE
        led = state.phase is EngagementPhase.ENABLED or (clutched and state.current is TeleopState.ENABLED)
        return (
            TeleopState.ENABLED if led and state.desired is TeleopState.ENABLED else TeleopState.ALIGNING_MTM
        )

    def _permit_following(self, *, leads: bool) -> None:
        """Enable or clutch the teleoperation."""
        if leads != self.state.leads:
            self.state.leads = Published(leads)
            joy = Joy(buttons=np.array([not leads], np.int32))
            self._events.publish(f"teleop/{self.name}/buttons", joy)

    def _set_arms(self, readiness: Readiness, names: Set[str]) -> None:
        """Command arm and master, if among `names`, to be enabled and homed."""
        for name in (self.arm, self.master):
            for command in readiness.state_commands(name) if name in names else ():
                self._events.publish(f"{name}/state_command", StringStamped(string=command))

    def _enter(self) -> None:
        """Begin the current state."""
        state = self.state
        self._publish_state()
        if state.current is TeleopState.DISABLED or (
            state.current is TeleopState.ALIGNING_MTM and not state.align
        ):
            self._commands.hold()
        if state.current is TeleopState.ALIGNING_MTM:
            state.aligned_ns = -_ALIGN_NS
            self._publish("scale", Float64Message(data=state.scale))

    def _command_master(self, inputs: Inputs, now_ns: int, *, floats: bool, clutched: bool) -> None:
        state = self.state
        if floats:
            locked = state.rotation_locked or (clutched and state.align)
            self._commands.float_free(inputs[f"{self.master}/measured_cp"][3:] if locked else None)
        aligns = state.current is TeleopState.ALIGNING_MTM and state.align and not clutched
        if aligns and now_ns - state.aligned_ns >= _ALIGN_NS:
            state.aligned_ns = now_ns
            master, tip = inputs[f"{self.master}/measured_cp"], inputs[f"{self.arm}/setpoint_cp"]
            self._commands.turn(master, tip[3:])
            header = Header(stamp=Time.from_ns(now_ns))
            offset_to_tip = orientation_offset(master[3:], tip[3:])
            self._publish("alignment_offset", QuaternionStamped(header=header, quaternion=offset_to_tip))

    def warn(self, text: str) -> None:
        """Publish why something is not done."""
        self._publish("warning", StringMessage(data=f"{self.name}: {text}"))

    def _publish_state(self) -> None:
        self._publish("current_state", StringMessage(data=self.state.current.name))

    def _publish(self, name: str, message: Message) -> None:
        self._events.publish(f"{self.name}/{name}", message)
