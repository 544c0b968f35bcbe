"""Teleoperation: the hand's motion, scaled, becomes the motion of an instrument's tip.

The mapping is relative, as on the da Vinci: the hand's way since the reference was taken is added to where the tip was
then. The reference is taken anew whenever the hand comes back (clutch released, device heard again) or the scale changes,
from where the hand and the command are at that moment, so the command never jumps.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field, model_validator

from hub.inputs import Inputs
from hub.participant import Outputs, Params, Setup, Stepped, state_hash
from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from robots.dvrk.parameters import ArmName, PsmPositions, UnitQuaternion, check_start
from robots.inverse_kinematics import approach
from schemas.errors import StateError
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import Joy
from schemas.vectors import Vector

__all__ = ["Teleoperation", "TeleoperationParams"]

_JOINTS = len(psm.JOINT_NAMES)
_TOOL = "palpation-probe"
_POSE, _JOINT_STATE = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/JointState"


class TeleoperationParams(Params):
    """How a hand drives an arm."""

    arm: ArmName = "PSM1"
    scale: float = Field(default=0.2, gt=0.0, le=1.0, description="metres of the tip per metre of the hand; also an input, to be changed while it runs")
    orientation: Literal["hold", "follow"] = Field(default="hold", description="whether the tip keeps its orientation or turns with the hand")
    registration: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0), description="orientation of the master's frame in the arm's base frame: quaternion x, y, z, w"
    )
    start: PsmPositions = Field(default=psm.HOME, description=f"the command until measured_js is there: {', '.join(psm.JOINT_NAMES)}")
    max_age: Duration = Field(default=100_000_000, gt=0, description="the arm holds when the master has been silent for longer")

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(psm.chain(instrument(_TOOL)), self.start)
        return self


class Teleoperation(Stepped):
    """One hand, one arm. The tip is goal = tip0 + scale R (hand - hand0); R turns from the master's frame to the arm's base.

    Button 0 of `buttons` is the clutch: while it is pressed the arm holds and the hand is free. Without any button the arm
    follows whenever the master is heard.
    """

    params_model: ClassVar[type[Params]] = TeleoperationParams
    params: TeleoperationParams

    def __init__(self, name: str, params: TeleoperationParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._chain = psm.chain(instrument(_TOOL))
        self._registration = np.array(params.registration)
        self._to_base = rotation.matrix(self._registration)
        self._state = np.zeros(24)
        self._command, self._hand, self._tip, self._scale, self._following, self._clutched, self._started = np.split(self._state, [6, 13, 20, 21, 22, 23])
        self._goal = np.empty(7)
        self._outputs = {"servo_jp": self._command, "goal_cp": self._goal}

    @property
    def ports(self) -> tuple[Port, ...]:
        """The hand (`master`, `buttons`), the arm (`measured_js`) and the `scale` in; `servo_jp` and `goal_cp` out."""
        p, names = self.params, psm.JOINT_NAMES
        fields = ("position", "velocity", "effort")
        at_rest = p.start + (0.0,) * (2 * _JOINTS)
        return (
            Port(name="master", causality="input", type=_POSE, max_age_ns=p.max_age, description="pose of the hand"),
            Port(name="buttons", causality="input", type="sensor_msgs/msg/Joy", variability="event", description="button 0: clutch"),
            Port(
                name="measured_js", causality="input", type=_JOINT_STATE, names=names, fields=fields, start=at_rest, description="read at the first step only"
            ),
            Port(name="scale", causality="input", type="std_msgs/msg/Float64", start=(p.scale,), description="metres of the tip per metre of the hand"),
            Port(name="servo_jp", causality="output", type=_JOINT_STATE, names=names, description="command to the arm's joint servos"),
            Port(name="goal_cp", causality="output", type=_POSE, frame=f"{p.arm}_base", description="where the tip is told to be"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the arm held where the parameters say."""
        self._command[:] = self.params.start
        self._goal[:] = self._tip_pose()
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Move the command towards the hand's goal, at most as fast as the joints may; hold it if nobody leads."""
        if not self._started[0]:
            self._command[:] = np.clip(inputs["measured_js"][:_JOINTS], self._chain.lower, self._chain.upper)
            self._started[0] = 1.0
        self._heed(inputs.events("buttons"))
        hand, scale = inputs["master"], float(inputs["scale"][0])
        if self._clutched[0] or inputs.stale("master"):
            self._following[0] = 0.0
            self._goal[:] = self._tip_pose()
            return self._outputs
        if not self._following[0] or scale != self._scale[0]:
            self._take_reference(hand, scale)
        self._set_goal(hand)
        largest_move = self._chain.velocity * (h * 1e-9)
        self._command[:] = approach(self._chain, self._command, self._goal[:3], self._goal[3:], largest_move)
        return self._outputs

    def _heed(self, events: tuple[Message, ...]) -> None:
        """Follow the clutch. A press and a release inside one step still free the hand; a Joy without button 0 says nothing."""
        for joy in cast("tuple[Joy, ...]", events):
            if joy.buttons.size:
                self._clutched[0] = joy.buttons[0] != 0
                if self._clutched[0]:
                    self._following[0] = 0.0

    def _take_reference(self, hand: Vector, scale: float) -> None:
        self._hand[:], self._tip[:] = hand, self._tip_pose()
        self._scale[0], self._following[0] = scale, 1.0

    def _set_goal(self, hand: Vector) -> None:
        self._goal[:3] = self._tip[:3] + self._scale[0] * (self._to_base @ (hand[:3] - self._hand[:3]))
        self._goal[3:] = self._tip[3:]
        if self.params.orientation == "follow":
            turn = rotation.product(self._registration, rotation.product(hand[3:], rotation.conjugate(self._hand[3:])))
            goal = rotation.product(rotation.product(turn, rotation.conjugate(self._registration)), self._tip[3:])
            self._goal[3:] = goal / np.linalg.norm(goal)

    def _tip_pose(self) -> Vector:
        """Return the pose (x, y, z, qx, qy, qz, qw) of the tip at the command, in the arm's base frame."""
        tip = self._chain.forward(self._command)
        return np.concatenate([tip[:3, 3], rotation.from_matrix(tip)])

    def state_hash(self) -> int:
        """Return the hash of the command, the reference and the clutch."""
        return state_hash(self._state)

    def save(self) -> bytes:
        """Return the command, the reference and the clutch."""
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        if len(state) != self._state.nbytes:
            raise StateError(f"participant '{self.name}': a saved state of {len(state)} bytes, expected {self._state.nbytes}; was it saved elsewhere?")
        self._state[:] = np.frombuffer(state)

    def close(self) -> None:
        """Nothing is held."""
