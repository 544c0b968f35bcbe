"""One teleoperation component: a master, the arm that it leads, and how far they are on the way to it.

The states are those of mtsTeleOperationPSM.cpp (jhu-dvrk/sawIntuitiveResearchKit): DISABLED;
SETTING_ARMS_STATE until master and arm are enabled and homed; ALIGNING_MTM until the master is turned like
the tip and somebody holds it; ENABLED, in which the arm follows unless the clutch is pressed. Whether the
hand may take over is decided by the `teleoperation`, which knows where both are; here it is only let, or not.
"""

from __future__ import annotations

from collections.abc import Set
from enum import IntEnum
from typing import cast

import numpy as np

from controllers.dvrk_console.master import Master, offset, opening
from controllers.dvrk_console.params import ConsoleParams
from controllers.dvrk_console.readiness import Readiness
from controllers.dvrk_console.voice import Voice
from hub.participant import Inputs
from schemas.crtk import StringStamped
from schemas.errors import did_you_mean
from schemas.message import Message
from schemas.ros import BoolMessage, Float64Message, Header, Joy, QuaternionStamped, StringMessage, Time

__all__ = ["Component", "State"]

_ALIGN_NS = 10_000_000
"""Time from one order to turn to the next (RunAligningMTM)."""
_PHASES = ("DISABLED", "CLUTCHED", "ALIGNING", "ENABLED")
"""What a `teleoperation` says of itself."""


class State(IntEnum):
    """Of a component."""

    DISABLED = 0
    SETTING_ARMS_STATE = 1
    ALIGNING_MTM = 2
    ENABLED = 3


_COMMANDS = {"enable": State.ENABLED, "disable": State.DISABLED, "align_mtm": State.ALIGNING_MTM}


class Component:
    """One component. All that changes is in `state`."""

    def __init__(self, name: str, params: ConsoleParams, voice: Voice) -> None:
        """Take its name, `MTMR_PSM1`."""
        self.name, self._voice = name, voice
        self.master, self.arm = name.split("_")
        self._orders = Master(self.master, voice)
        self.state = np.zeros(13)
        parts = np.split(self.state, 13)
        (
            self._desired,
            self._wish,
            self._current,
            self._phase,
            self._following,
            self._let,
            self.selected,
            *parts,
        ) = parts
        self.scale, self.gripper, self._align, self._rotation, self._translation, self._aligned_ns = parts
        self._let[0], self._align[0] = -1.0, params.align_mtm
        self.scale[0], self.gripper[0] = params.scale, -1.0

    def introduce(self) -> None:
        """Say how it is: at the start, for those who come later."""
        self._tell_state()
        self._say("desired_state", StringMessage(data=State(int(self._desired[0])).name))
        self._say("following", BoolMessage(data=False))
        self._say("scale", Float64Message(data=float(self.scale[0])))
        for name, flag in (
            ("align_mtm", self._align),
            ("rotation_locked", self._rotation),
            ("translation_locked", self._translation),
        ):
            self._say(name, BoolMessage(data=bool(flag[0])))

    def set_scale(self, scale: float) -> None:
        """Take a scale, over 0 to 1."""
        self.scale[0] = scale
        self._say("scale", Float64Message(data=scale))

    def step(self, now_ns: int, inputs: Inputs, wish: State, readiness: Readiness, *, clutched: bool) -> None:
        """Go on towards what is wanted: `wish` is the console's, which counts whenever it changes."""
        self._heed(inputs)
        if wish != self._wish[0]:
            self._wish[0] = wish
            self._want(wish)
        self.gripper[0] = opening(float(inputs[f"{self.master}/gripper/measured_js"][0]))
        if lost := readiness.lost & {self.master, self.arm}:
            self._give_up(lost)
        before, followed = self._current[0], self._following[0]
        self._current[0] = self._next(readiness, clutched=clutched)
        self._let_lead(
            let=self._desired[0] == State.ENABLED and self._current[0] >= State.ALIGNING_MTM and not clutched
        )
        self._following[0] = (
            self._current[0] == State.ENABLED and _PHASES[int(self._phase[0])] == "ENABLED" and not clutched
        )
        if before != self._current[0]:
            self._enter()
        if self._current[0] == State.SETTING_ARMS_STATE:
            self._set_arms(
                readiness, {self.arm, self.master} if before != self._current[0] else readiness.new
            )
        if followed != self._following[0]:
            self._say("following", BoolMessage(data=bool(self._following[0])))
        self._lead_master(
            inputs,
            now_ns,
            floats=followed != self._following[0] and self._current[0] == State.ENABLED,
            clutched=clutched,
        )

    def _heed(self, inputs: Inputs) -> None:
        """Take what programs and the teleoperation say."""
        for order in cast("tuple[StringStamped, ...]", inputs.events(f"{self.name}/state_command")):
            if order.string in _COMMANDS:
                self._want(_COMMANDS[order.string])
            else:
                self.warn(
                    f"there is no state_command '{order.string}'.{did_you_mean(order.string, _COMMANDS)}"
                )
        for scale in cast("tuple[Float64Message, ...]", inputs.events(f"{self.name}/set_scale")):
            if 0.0 < scale.data <= 1.0:
                self.set_scale(scale.data)
            else:
                self.warn(
                    f"scale {scale.data:g} is refused, allowed are over 0 to 1; it stays {self.scale[0]:g}"
                )
        for name, told, flag in (
            ("rotation", "rotation_locked", self._rotation),
            ("translation", "translation_locked", self._translation),
        ):
            for wish in cast("tuple[BoolMessage, ...]", inputs.events(f"{self.name}/lock_{name}")):
                flag[0] = wish.data
                self._say(told, wish)
                self._voice.say(f"teleop/{self.name}/lock_{name}", wish)
        for wish in cast("tuple[BoolMessage, ...]", inputs.events(f"{self.name}/set_align_MTM")):
            self._align[0] = wish.data
            self._say("align_mtm", wish)
        for phase in cast("tuple[StringMessage, ...]", inputs.events(f"teleop/{self.name}/state")):
            self._phase[0] = _PHASES.index(phase.data)
        for message in cast("tuple[StringMessage, ...]", inputs.events(f"teleop/{self.name}/warning")):
            self._say("warning", message)

    def _want(self, state: State) -> None:
        self._desired[0] = state
        self._say("desired_state", StringMessage(data=state.name))

    def _give_up(self, lost: Set[str]) -> None:
        """Somebody is not ready any more: as on the real system, nobody is led until it is asked for anew."""
        if self._current[0] >= State.ALIGNING_MTM:
            self.warn(
                f"{' and '.join(sorted(lost))} not ENABLED and homed any more; send state_command enable"
            )
            self._want(State.DISABLED)

    def _next(self, readiness: Readiness, *, clutched: bool) -> State:
        if self._desired[0] == State.DISABLED:
            return State.DISABLED
        if not (readiness.is_ready(self.arm) and readiness.may_lead(self.master)):
            return State.SETTING_ARMS_STATE
        led = _PHASES[int(self._phase[0])] == "ENABLED" or (clutched and self._current[0] == State.ENABLED)
        return State.ENABLED if led and self._desired[0] == State.ENABLED else State.ALIGNING_MTM

    def _let_lead(self, *, let: bool) -> None:
        """Let the hand lead, or free it: its teleoperation takes that as its clutch."""
        if let != self._let[0]:
            self._let[0] = let
            self._voice.say(f"teleop/{self.name}/buttons", Joy(buttons=np.array([not let], np.int32)))

    def _set_arms(self, readiness: Readiness, names: Set[str]) -> None:
        """Order arm and master, if they are among `names`, to be enabled and homed."""
        for name in (self.arm, self.master):
            for command in readiness.orders(name) if name in names else ():
                self._voice.say(f"{name}/state_command", StringStamped(string=command))

    def _enter(self) -> None:
        """Say what the state is; begin it."""
        self._tell_state()
        if self._current[0] == State.DISABLED or (
            self._current[0] == State.ALIGNING_MTM and not self._align[0]
        ):
            self._orders.hold()
        if self._current[0] == State.ALIGNING_MTM:
            self._aligned_ns[0] = -_ALIGN_NS
            self._say("scale", Float64Message(data=float(self.scale[0])))

    def _lead_master(self, inputs: Inputs, now_ns: int, *, floats: bool, clutched: bool) -> None:
        master, tip = inputs[f"{self.master}/measured_cp"], inputs[f"{self.arm}/setpoint_cp"]
        if floats:
            locked = bool(self._rotation[0]) or (clutched and bool(self._align[0]))
            self._orders.float(master[3:] if locked else None)
        aligns = self._current[0] == State.ALIGNING_MTM and bool(self._align[0]) and not clutched
        if aligns and now_ns - self._aligned_ns[0] >= _ALIGN_NS:
            self._aligned_ns[0] = now_ns
            self._orders.turn(master, tip[3:])
            self._say(
                "alignment_offset",
                QuaternionStamped(
                    header=Header(stamp=Time.from_ns(now_ns)), quaternion=offset(master[3:], tip[3:])
                ),
            )

    def warn(self, text: str) -> None:
        """Say what is not done."""
        self._say("warning", StringMessage(data=f"{self.name}: {text}"))

    def _tell_state(self) -> None:
        self._say("current_state", StringMessage(data=State(int(self._current[0])).name))

    def _say(self, name: str, message: Message) -> None:
        self._voice.say(f"{self.name}/{name}", message)
