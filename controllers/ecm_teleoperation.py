"""Teleoperation of the endoscope by the surgeon's head.

The law of Ferro et al., "A Portable da Vinci Simulator in Virtual Reality", IEEE International Conference on
Robotic Computing, 2019: with (v_R, w_R) the twist of the head-mounted display in its own frame, that of the
camera in its own frame shall have v_C,z = v_R,z and w_C = w_R. As the four joints cannot do both, there are
two modes, between which the user switches:

    orientation    dq_{1,2,4}/dt = pinv(J_w) w_R,    dq_3/dt = 0
    position       dq_3/dt = v_R,z,                  dq_{1,2,4}/dt = 0

J_w are the three angular rows of the camera's Jacobian in its own frame. Inside the joint ranges they have
full rank (their determinant is the cosine of the pitch). The paper's z axis looks ahead; a head's own frame
here has x ahead, y to the left and z up.

Joints that would be too fast slow down together, so that the camera turns about the right axis. A joint at
the end of its range stops, and the others do what they can without it. What is cut is not made up for later.
"""

from __future__ import annotations

from enum import IntEnum
from typing import ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field, model_validator

from controllers.ports import measured_joints
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    choice,
    event_in,
    event_out,
    flag,
    number,
    signal_in,
    signal_out,
)
from robots import rotation
from robots.dvrk import crtk, ecm
from robots.dvrk.parameters import EcmPositions, check_start
from robots.serial_chain import SerialChain
from schemas.crtk import OperatingState
from schemas.errors import did_you_mean
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import Float64Message, JointState, Joy, PoseStamped, StringMessage, TwistStamped
from schemas.vectors import Vector

__all__ = ["EcmTeleoperation", "EcmTeleoperationParams", "joint_velocities"]

_JOINTS = len(ecm.JOINT_NAMES)
_TURNING, _INSERTION = [0, 1, 3], 2

_CAMERA_IN_HEAD = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Rotation from a head's axes (x ahead, y left, z up) to the camera's (x left, y up, z ahead;
robots.dvrk.ecm, tip frame `view`).
"""


class Mode(IntEnum):
    """What follows the head."""

    ORIENTATION = 0
    POSITION = 1


_MODES = {mode.name.lower(): mode for mode in Mode}


class EcmButtons(Params):
    """Which button does what, counted from 0."""

    mode: int | None = Field(default=0, ge=0, description="each press changes between turning and moving")
    dead_man: int | None = Field(
        default=None,
        ge=0,
        description="the camera follows only while it is held; default: whenever the head's pose is fresh",
    )


class EcmTeleoperationParams(Params):
    """How a head leads the endoscope."""

    open_to_pages: ClassVar[bool] = True

    endoscope: ecm.Endoscope = Field(
        default="straight",
        description="as the ECM has it: where it looks, along its shaft or 30 degrees up or down",
    )
    start: EcmPositions = Field(
        default=ecm.HOME, description=f"the command until measured_js is there: {', '.join(ecm.JOINT_NAMES)}"
    )
    mode: Literal["orientation", "position"] = Field(
        default="orientation", description="turn as the head turns, or go in and out as it does"
    )
    scale: float = Field(
        default=1.0,
        gt=0.0,
        description="motion of the camera over that of the head; also an input, to be changed while it runs",
    )
    buttons: EcmButtons = EcmButtons()
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="the camera holds when the head has been silent for longer"
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        check_start(ecm.chain(), self.start)
        if self.buttons.mode is not None and self.buttons.mode == self.buttons.dead_man:
            raise ValueError(f"button {self.buttons.mode} cannot be both 'mode' and 'dead_man'")
        return self


def joint_velocities(chain: SerialChain, q: Vector, twist: Vector, mode: Mode, free: Vector) -> Vector:
    """Return dq/dt, shape (4,), rad/s and m/s, by the law of `mode`.

    Args:
        chain: kinematics up to the camera as it sees (tip frame `view`).
        q: joint positions, shape (4,).
        twist: of the head (6,) in its own frame (x ahead, y left, z up): velocity of its origin, then angular
            velocity.
        mode: what follows the head.
        free: the joints that may move, shape (4,) of bools; the others are at rest.
    """
    velocities = np.zeros(_JOINTS)
    if mode is Mode.POSITION:
        velocities[_INSERTION] = twist[0] if free[_INSERTION] else 0.0
    elif turning := [joint for joint in _TURNING if free[joint]]:
        frames = chain.frames(q)
        # (3, <= 3): the joints' axes in the camera's frame
        jacobian = frames[-1, :3, :3].T @ frames[turning, :3, 2].T
        # pinv(J_w) w, at a third of its cost
        velocities[turning] = np.linalg.lstsq(jacobian, _CAMERA_IN_HEAD @ twist[3:], rcond=None)[0]
    return velocities


def _limit_speeds(chain: SerialChain, q: Vector, twist: Vector, mode: Mode) -> Vector:
    """Return dq/dt, shape (4,), within the speed limits, and none out of a joint's range."""
    free = np.ones(_JOINTS, dtype=bool)
    while True:
        velocities = joint_velocities(chain, q, twist, mode, free)
        velocities /= max(1.0, float(abs(velocities / chain.velocity).max()))
        if chain.contains(q):
            return velocities
        blocked = ((q <= chain.lower) & (velocities < 0.0)) | ((q >= chain.upper) & (velocities > 0.0))
        if not blocked.any():
            return velocities
        free &= ~blocked


class EcmTeleoperationState(Record):
    """Command and settings."""

    command = array(_JOINTS)
    velocity = array(_JOINTS)
    mode = choice(Mode.ORIENTATION)
    mode_pressed = flag()
    """Whether the button that changes the mode is down."""
    held = flag()
    """Whether the dead-man button is down."""
    ready = flag()
    """Whether the arm is ENABLED and homed."""
    started = flag()
    scale = number()
    requested_scale = number()
    """Newest value of the input, valid or not."""


class EcmTeleoperation(Controller):
    """A head, one endoscope.

    Nothing moves while the head's pose is not fresh, the dead-man is released, or the arm is not ready.
    """

    params_model: ClassVar[type[Params]] = EcmTeleoperationParams
    params: EcmTeleoperationParams

    def __init__(self, name: str, params: EcmTeleoperationParams) -> None:
        super().__init__(name, params)
        self._chain = ecm.chain(params.endoscope, "view")
        self._now = EcmTeleoperationState()
        self.keep(self._now)
        self._command, self._velocity = self._now.command, self._now.velocity

    @property
    def ports(self) -> tuple[Port, ...]:
        """The head, mode, scale and the arm's state in; the command to its servos out."""
        p, names = self.params, ecm.JOINT_NAMES
        scale, moves = "motion of the camera over that of the head", "with which the command moves"
        read = "read at the start and whenever the arm becomes ready"
        return (
            signal_in("pose", PoseStamped, "pose of the head: x ahead, y left, z up", max_age_ns=p.max_age),
            signal_in("twist", TwistStamped, "of the head, in the frame of its pose", max_age_ns=p.max_age),
            event_in("mode", StringMessage, " or ".join(_MODES)),
            event_in("buttons", Joy, "mode and dead-man, as the parameters say"),
            signal_in("scale", Float64Message, scale, start=(p.scale,)),
            event_in("operating_state", OperatingState, "of the ECM; unconnected: ready"),
            measured_joints("measured_js", names, read, start=p.start),
            signal_out("servo_jp", JointState, "command to the ECM's joint servos", names=names),
            signal_out("joint_velocity", JointState, moves, names=names, fields=("velocity",)),
            event_out("active_mode", StringMessage, "whenever it changes"),
            event_out("warning", StringMessage, "a command that is refused"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the arm held where the parameters state it."""
        self._command[:] = self.params.start
        self._now.mode, self._now.ready = _MODES[self.params.mode], True
        self._now.scale = self._now.requested_scale = self.params.scale
        return self._outputs((_mode_message(self._now.mode),), ())

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Move the command with the velocity that follows from the head's twist."""
        before = self._now.mode
        self._receive_state(inputs.events("operating_state"))
        warnings = self._receive_mode(inputs.events("mode")) + self._set_scale(float(inputs["scale"][0]))
        self._receive_buttons(inputs.events("buttons"))
        if not self._now.started:
            self._command[:] = np.clip(inputs["measured_js"][:_JOINTS], self._chain.lower, self._chain.upper)
            self._now.started = True
        self._velocity[:] = self._velocities(inputs) if self._follows(inputs) else 0.0
        goal = self._command + self._velocity * (h * 1e-9)
        if self._chain.contains(goal):
            self._command[:] = goal
        else:
            self._stop_at_ends(goal, h * 1e-9)
        changed = (_mode_message(self._now.mode),) if self._now.mode is not before else ()
        return self._outputs(changed, warnings)

    def _stop_at_ends(self, goal: Vector, seconds: float) -> None:
        """Go to `goal`, shape (4,), as far as the joints' ranges allow, with the velocity that this takes."""
        within = np.clip(goal, self._chain.lower, self._chain.upper)
        self._velocity[:] = np.where(within == goal, self._velocity, (within - self._command) / seconds)
        self._command[:] = within

    def _follows(self, inputs: Inputs) -> bool:
        held = self.params.buttons.dead_man is None or self._now.held
        return held and self._now.ready and not (inputs.stale("pose") or inputs.stale("twist"))

    def _velocities(self, inputs: Inputs) -> Vector:
        """Return dq/dt, shape (4,), for the twist of the head, turned into its own frame and scaled."""
        to_head, twist = rotation.matrix(inputs["pose"][3:]).T, inputs["twist"]
        own = self._now.scale * np.concatenate([to_head @ twist[:3], to_head @ twist[3:]])
        return _limit_speeds(self._chain, self._command, own, self._now.mode)

    def _receive_state(self, events: tuple[Message, ...]) -> None:
        """Start where the arm is when it becomes ready: it may have been moved."""
        for state in cast("tuple[OperatingState, ...]", events):
            ready = crtk.is_ready(state)
            if ready and not self._now.ready:
                self._now.started = False
            self._now.ready = ready

    def _receive_mode(self, events: tuple[Message, ...]) -> tuple[StringMessage, ...]:
        warnings: list[StringMessage] = []
        for mode in cast("tuple[StringMessage, ...]", events):
            if mode.data in _MODES:
                self._now.mode = _MODES[mode.data]
            else:
                warnings.append(
                    StringMessage(data=f"there is no mode '{mode.data}'.{did_you_mean(mode.data, _MODES)}")
                )
        return tuple(warnings)

    def _set_scale(self, scale: float) -> tuple[StringMessage, ...]:
        """Set the scale; return why it is refused, once."""
        is_new, self._now.requested_scale = scale != self._now.requested_scale, scale
        if scale > 0.0:
            self._now.scale = scale
            return ()
        return (
            (
                StringMessage(
                    data=f"scale {scale:g} is refused, it must be above 0; it stays {self._now.scale:g}"
                ),
            )
            if is_new
            else ()
        )

    def _receive_buttons(self, events: tuple[Message, ...]) -> None:
        """Read the buttons; a Joy without one of them does not change it."""
        keys = self.params.buttons
        for joy in cast("tuple[Joy, ...]", events):
            if keys.dead_man is not None and keys.dead_man < joy.buttons.size:
                self._now.held = bool(joy.buttons[keys.dead_man] != 0)
            if keys.mode is not None and keys.mode < joy.buttons.size:
                pressed = bool(joy.buttons[keys.mode] != 0)
                if pressed and not self._now.mode_pressed:
                    self._now.mode = Mode(1 - self._now.mode)
                self._now.mode_pressed = pressed

    def _outputs(self, modes: tuple[StringMessage, ...], warnings: tuple[StringMessage, ...]) -> Outputs:
        return {
            "servo_jp": self._command,
            "joint_velocity": self._velocity,
            "active_mode": modes,
            "warning": warnings,
        }


def _mode_message(mode: Mode) -> StringMessage:
    return StringMessage(data=mode.name.lower())
