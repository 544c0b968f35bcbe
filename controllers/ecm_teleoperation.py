"""Teleoperation of the endoscope by the surgeon's head.

The law of Ferro et al., "A Portable da Vinci Simulator in Virtual Reality", IEEE International Conference on
Robotic Computing, 2019: of the twist of the head-mounted display in its own frame (v_R, w_R) the camera is to
have, in its own frame, v_C,z = v_R,z and w_C = w_R. As the four joints cannot do both, there are two modes,
between which the user switches:

    orientation    dq_{1,2,4}/dt = pinv(J_w) w_R,    dq_3/dt = 0
    position       dq_3/dt = v_R,z,                  dq_{1,2,4}/dt = 0

J_w are the three angular rows of the camera's Jacobian in its own frame. Inside the joint ranges they have
full rank (their determinant is the cosine of the pitch). The paper's z axis looks ahead; a head's own frame
here has x ahead, y to the left and z up.

Joints that would be too fast slow down together, so that the camera turns about the right axis; one at the
end of its range stands, and the others do what they can without it. What is cut is not made up for later.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field, model_validator

from hub.participant import Inputs, Outputs, Params, Setup, Stepped, restore_arrays, state_hash
from robots import rotation
from robots.dvrk import ecm
from robots.dvrk.parameters import EcmPositions, check_start
from robots.serial_chain import SerialChain
from schemas.crtk import OperatingState
from schemas.errors import did_you_mean
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import Joy, StringMessage
from schemas.vectors import Vector

__all__ = ["EcmTeleoperation", "EcmTeleoperationParams", "joint_velocities"]

_JOINTS = len(ecm.JOINT_NAMES)
_TURNING, _INSERTION = [0, 1, 3], 2
_MODES = ("orientation", "position")
_FIELDS: tuple[Literal["position", "velocity", "effort"], ...] = ("position", "velocity", "effort")
_JOINT_STATE, _STRING = "sensor_msgs/msg/JointState", "std_msgs/msg/String"

_CAMERA_IN_HEAD = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""From a head's axes (x ahead, y left, z up) to those in which the camera sees (x left, y up, z ahead;
robots.dvrk.ecm, tip frame `view`).
"""


class EcmButtons(Params):
    """Which button does what, counted from 0."""

    mode: int | None = Field(default=0, ge=0, description="each press changes between turning and moving")
    dead_man: int | None = Field(
        default=None,
        ge=0,
        description="the camera follows only while it is held; default: whenever the head is heard",
    )


class EcmTeleoperationParams(Params):
    """How a head leads the endoscope."""

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


def joint_velocities(chain: SerialChain, q: Vector, twist: Vector, mode: str, free: Vector) -> Vector:
    """Return dq/dt, shape (4,), rad/s and m/s, by the law of `mode`.

    Args:
        chain: kinematics up to the camera as it sees (tip frame `view`).
        q: joint positions, shape (4,).
        twist: of the head (6,) in its own frame (x ahead, y left, z up): velocity of its origin, then angular
        velocity.
        mode: `orientation` or `position`.
        free: the joints that may move, shape (4,) of bools; the others are at rest.
    """
    velocities = np.zeros(_JOINTS)
    if mode == "position":
        velocities[_INSERTION] = twist[0] if free[_INSERTION] else 0.0
    elif turning := [joint for joint in _TURNING if free[joint]]:
        frames = chain.frames(q)
        # (3, <= 3): the joints' axes in the camera's frame
        jacobian = frames[-1, :3, :3].T @ frames[turning, :3, 2].T
        # pinv(J_w) w, at a third of its cost
        velocities[turning] = np.linalg.lstsq(jacobian, _CAMERA_IN_HEAD @ twist[3:], rcond=None)[0]
    return velocities


def _limited(chain: SerialChain, q: Vector, twist: Vector, mode: str) -> Vector:
    """Return dq/dt, shape (4,), that no joint's speed limit forbids, and no joint at the end of its range."""
    free = np.ones(_JOINTS, dtype=bool)
    while True:
        velocities = joint_velocities(chain, q, twist, mode, free)
        velocities /= max(1.0, float(np.abs(velocities / chain.velocity).max()))
        blocked = ((q <= chain.lower) & (velocities < 0.0)) | ((q >= chain.upper) & (velocities > 0.0))
        if not blocked.any():
            return velocities
        free &= ~blocked


class EcmTeleoperation(Stepped):
    """One head, one endoscope. Nothing moves while the head is not heard, the dead-man is open, or the arm is
    not ready.
    """

    params_model: ClassVar[type[Params]] = EcmTeleoperationParams
    params: EcmTeleoperationParams

    def __init__(self, name: str, params: EcmTeleoperationParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._chain = ecm.chain(params.endoscope, "view")
        self._state = np.zeros(2 * _JOINTS + 7)
        (
            self._command,
            self._velocity,
            self._mode,
            self._pressed,
            self._held,
            self._ready,
            self._started,
            self._scale,
            self._heard,
        ) = np.split(self._state, np.cumsum([_JOINTS, _JOINTS, 1, 1, 1, 1, 1, 1]))

    @property
    def ports(self) -> tuple[Port, ...]:
        """The head, the user's wishes and the arm's state in; the command to its servos out."""
        p, names = self.params, ecm.JOINT_NAMES
        at_rest = p.start + (0.0,) * (2 * _JOINTS)
        pose, twist, joy = (
            "geometry_msgs/msg/PoseStamped",
            "geometry_msgs/msg/TwistStamped",
            "sensor_msgs/msg/Joy",
        )
        read = "read at the start and whenever the arm becomes ready"
        return (
            Port(
                name="pose",
                causality="input",
                type=pose,
                max_age_ns=p.max_age,
                description="pose of the head: x ahead, y left, z up",
            ),
            Port(
                name="twist",
                causality="input",
                type=twist,
                max_age_ns=p.max_age,
                description="of the head, in the frame of its pose",
            ),
            Port(
                name="mode",
                causality="input",
                type=_STRING,
                variability="event",
                description=" or ".join(_MODES),
            ),
            Port(
                name="buttons",
                causality="input",
                type=joy,
                variability="event",
                description="mode and dead-man, as the parameters say",
            ),
            Port(
                name="scale",
                causality="input",
                type="std_msgs/msg/Float64",
                start=(p.scale,),
                description="motion of the camera over that of the head",
            ),
            Port(
                name="operating_state",
                causality="input",
                type=OperatingState.ros_type,
                variability="event",
                description="of the ECM; unconnected: ready",
            ),
            Port(
                name="measured_js",
                causality="input",
                type=_JOINT_STATE,
                names=names,
                fields=("position", "velocity", "effort"),
                start=at_rest,
                description=read,
            ),
            Port(
                name="servo_jp",
                causality="output",
                type=_JOINT_STATE,
                names=names,
                description="command to the ECM's joint servos",
            ),
            Port(
                name="joint_velocity",
                causality="output",
                type=_JOINT_STATE,
                names=names,
                fields=("velocity",),
                description="with which the command moves",
            ),
            Port(
                name="active_mode",
                causality="output",
                type=_STRING,
                variability="event",
                description="whenever it changes",
            ),
            Port(
                name="warning",
                causality="output",
                type=_STRING,
                variability="event",
                description="a wish that cannot be heeded",
            ),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the arm held where the parameters say."""
        self._command[:] = self.params.start
        self._mode[0], self._ready[0] = _MODES.index(self.params.mode), 1.0
        self._scale[0] = self._heard[0] = self.params.scale
        return self._outputs((StringMessage(data=self.params.mode),), ())

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Move the command with the velocity that the head's twist asks for."""
        before = self._mode[0]
        self._heed_state(inputs.events("operating_state"))
        warnings = self._heed_mode(inputs.events("mode")) + self._heed_scale(float(inputs["scale"][0]))
        self._heed_buttons(inputs.events("buttons"))
        if not self._started[0]:
            self._command[:] = np.clip(inputs["measured_js"][:_JOINTS], self._chain.lower, self._chain.upper)
            self._started[0] = 1.0
        self._velocity[:] = self._asked(inputs) if self._follows(inputs) else 0.0
        goal = self._command + self._velocity * (h * 1e-9)
        within = np.clip(goal, self._chain.lower, self._chain.upper)
        self._velocity[:] = np.where(within == goal, self._velocity, (within - self._command) / (h * 1e-9))
        self._command[:] = within
        changed = (StringMessage(data=self._mode_name),) if self._mode[0] != before else ()
        return self._outputs(changed, warnings)

    @property
    def _mode_name(self) -> str:
        return _MODES[int(self._mode[0])]

    def _follows(self, inputs: Inputs) -> bool:
        held = self.params.buttons.dead_man is None or bool(self._held[0])
        return held and bool(self._ready[0]) and not (inputs.stale("pose") or inputs.stale("twist"))

    def _asked(self, inputs: Inputs) -> Vector:
        """Return dq/dt, shape (4,), for the twist of the head, turned into its own frame and scaled."""
        to_head, twist = rotation.matrix(inputs["pose"][3:]).T, inputs["twist"]
        own = self._scale[0] * np.concatenate([to_head @ twist[:3], to_head @ twist[3:]])
        return _limited(self._chain, self._command, own, self._mode_name)

    def _heed_state(self, events: tuple[Message, ...]) -> None:
        """An arm that becomes ready again may stand elsewhere: start from there."""
        for state in cast("tuple[OperatingState, ...]", events):
            ready = state.state == "ENABLED" and state.is_homed
            if ready and not self._ready[0]:
                self._started[0] = 0.0
            self._ready[0] = ready

    def _heed_mode(self, events: tuple[Message, ...]) -> tuple[StringMessage, ...]:
        warnings: list[StringMessage] = []
        for wish in cast("tuple[StringMessage, ...]", events):
            if wish.data in _MODES:
                self._mode[0] = _MODES.index(wish.data)
            else:
                warnings.append(
                    StringMessage(data=f"there is no mode '{wish.data}'.{did_you_mean(wish.data, _MODES)}")
                )
        return tuple(warnings)

    def _heed_scale(self, scale: float) -> tuple[StringMessage, ...]:
        """Take the scale; return what is wrong with it, once."""
        news, self._heard[0] = scale != self._heard[0], scale
        if scale > 0.0:
            self._scale[0] = scale
            return ()
        return (
            (
                StringMessage(
                    data=f"scale {scale:g} is refused, it must be above 0; it stays {self._scale[0]:g}"
                ),
            )
            if news
            else ()
        )

    def _heed_buttons(self, events: tuple[Message, ...]) -> None:
        """Follow the buttons; a Joy without one of them says nothing of it."""
        keys = self.params.buttons
        for joy in cast("tuple[Joy, ...]", events):
            if keys.dead_man is not None and keys.dead_man < joy.buttons.size:
                self._held[0] = joy.buttons[keys.dead_man] != 0
            if keys.mode is not None and keys.mode < joy.buttons.size:
                pressed = joy.buttons[keys.mode] != 0
                if pressed and not self._pressed[0]:
                    self._mode[0] = 1.0 - self._mode[0]
                self._pressed[0] = pressed

    def _outputs(self, modes: tuple[StringMessage, ...], warnings: tuple[StringMessage, ...]) -> Outputs:
        return {
            "servo_jp": self._command,
            "joint_velocity": self._velocity,
            "active_mode": modes,
            "warning": warnings,
        }

    def state_hash(self) -> int:
        """Return the hash of the command, its velocity, the mode, the buttons and the scale."""
        return state_hash(self._state)

    def save(self) -> bytes:
        """Return what is hashed."""
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        restore_arrays(self.name, (self._state,), state)

    def close(self) -> None:
        """Nothing is held."""
