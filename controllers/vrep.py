"""The topics of the authors' simulator: what programs written for it say and hear, over a robot that is
simulated here.

Ferro et al., "A Portable da Vinci Simulator in Virtual Reality", 2019; names, sizes and mappings as in the
scripts of their scenes (unina-icaros/dvrk-vrep, 88fe5975). Ports are named as the topics. As there, desired
joint positions go straight to the joints, without a motion controller: here to their servos, cut at the
joints' ranges. States are words that are echoed, and mean nothing.

docs/decisions/0032 says what is not as there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.motion.params import Arms, EcmParams, PsmParams, SetupJoints
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, Value, restore_arrays, state_hash
from robots.dvrk import setup_joints
from robots.dvrk.setup_joints import CartArm
from schemas.ports import Port
from schemas.ros import BoolMessage, JointState, StringMessage
from schemas.vectors import Vector

__all__ = ["Paper", "PaperParams"]

_JOINT_STATE, _STRING = "sensor_msgs/msg/JointState", "std_msgs/msg/String"
_HALF_ANGLE = 0.4106
"""rad of half the jaw's opening per unit of a command."""
_WRIST_YAW = {"PSM2": 0.8212}
"""By what the last joint of an arm is scaled."""
_OPEN = 2.0 * _HALF_ANGLE
"""rad; opening of a jaw that lets a needle go: at command 1, ours."""
_STATES = {
    "PSM1": ("current_state", "READY"),
    "PSM2": ("robot_state", "uninitialized"),
    "PSM3": ("robot_state", "uninitialized"),
}
"""Name of the topic, and the word at the start; the authors' scenes have no PSM3."""
_DESIRED = ("state_joint_desired", "set_position_joint", "set_position_goal_joint")
"""Topics of desired joint positions: in most scenes, of the authors' Python client, in the scenes of tracking
and servoing.
"""
_SETUP: tuple[tuple[CartArm, int], ...] = (("PSM1", 5), ("PSM2", 5), ("ECM", 4))
"""Right, left, camera: how many of their setup joints are told, the lift first."""


class PaperParams(Params):
    """Which arms there are, as the robot is told them."""

    arms: Arms
    setup_joints: SetupJoints = Field(
        default=SetupJoints(), description="where they are set, as the robot is told"
    )


class Paper(Stepped):
    """Desired positions, jaws and words in under `dvrk/`; `servo_jp` to the robot, and its states under
    `dvrk/` out.
    """

    params_model: ClassVar[type[Params]] = PaperParams
    params: PaperParams

    def __init__(self, name: str, params: PaperParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._arms = [_Arm(name, arm) for name, arm in params.arms.driven.items()]
        stated = params.setup_joints
        self._setup = np.concatenate([_set(stated, arm)[:count] for arm, count in _SETUP])

    @property
    def ports(self) -> tuple[Port, ...]:
        """The topics of the authors' simulator, and the robot's own ports."""
        still = {"causality": "output", "type": _JOINT_STATE}
        return (
            *(port for arm in self._arms for port in arm.ports),
            Port(
                name="release_needle",
                causality="input",
                type="std_msgs/msg/Bool",
                variability="event",
                description="true: every jaw opens",
            ),
            Port.model_validate(
                {
                    "name": "dvrk/setup_joint/state_joint_current",
                    "size": self._setup.size,
                    "description": "right, left, camera",
                }
                | still
            ),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start where the parameters say."""
        outputs: dict[str, Value] = {"dvrk/setup_joint/state_joint_current": self._setup}
        return outputs | {port: value for arm in self._arms for port, value in arm.outputs.items()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Hand on what is desired and what is measured."""
        release = any(
            message.data for message in cast("tuple[BoolMessage, ...]", inputs.events("release_needle"))
        )
        outputs: dict[str, Value] = {"dvrk/setup_joint/state_joint_current": self._setup}
        for arm in self._arms:
            outputs |= arm.step(inputs, release=release)
        return outputs

    def state_hash(self) -> int:
        """Return the hash of what is desired and told."""
        return state_hash(*(arm.state for arm in self._arms))

    def save(self) -> bytes:
        """Return what is hashed."""
        return b"".join(arm.state.tobytes() for arm in self._arms)

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        restore_arrays(self.name, (arm.state for arm in self._arms), state)

    def close(self) -> None:
        """Nothing is held."""


class _Arm:
    """One arm. All that changes is in `state`."""

    def __init__(self, name: CartArm, params: PsmParams | EcmParams) -> None:
        self._name, self._joints = name, params.chain.joints
        self._lower, self._upper = params.chain.lower, params.chain.upper
        jaw = params.tool.jaw if isinstance(params, PsmParams) else None
        self._jaw = None if jaw is None else jaw.joint
        self._scale = np.ones(len(self._joints))
        self._scale[-1] = _WRIST_YAW.get(name, 1.0)
        n = len(self._joints)
        self.state = np.zeros(3 * n + 3)
        self._desired, self._current, self._jaw_desired, self._jaw_current, self._told = np.split(
            self.state, [n, 3 * n, 3 * n + 1, 3 * n + 2]
        )
        self._desired[:] = params.start
        self._current[:n] = self._desired / self._scale
        topic, dvrk = _STATES.get(name, ("", ""))[0], f"dvrk/{name}"
        self._state_topic = f"{dvrk}/{topic}" if topic else ""
        self.outputs: dict[str, Value] = {
            f"{name}/servo_jp": self._desired,
            f"{dvrk}/state_joint_current": self._current,
        }
        if topic:
            self.outputs[self._state_topic] = ()
        if self._jaw is not None and isinstance(params, PsmParams):
            self._jaw_desired[0], self._jaw_current[0] = (
                params.jaw,
                0.5 * params.jaw / (_HALF_ANGLE if name == "PSM1" else 1.0),
            )
            self.outputs |= {
                f"{name}/jaw/servo_jp": self._jaw_desired,
                f"{dvrk}/state_jaw_current": self._jaw_current,
            }

    @property
    def ports(self) -> Iterator[Port]:
        name, dvrk, names = self._name, f"dvrk/{self._name}", tuple(joint.name for joint in self._joints)
        for topic in _DESIRED:
            yield Port(
                name=f"{dvrk}/{topic}",
                causality="input",
                type=_JOINT_STATE,
                variability="event",
                description="set directly",
            )
        yield _measured(f"{name}/measured_js", names)
        yield Port(name=f"{name}/servo_jp", causality="output", type=_JOINT_STATE, names=names)
        yield Port(
            name=f"{dvrk}/state_joint_current",
            causality="output",
            type=_JOINT_STATE,
            size=len(names),
            fields=("position", "velocity"),
        )
        if self._state_topic:
            yield Port(
                name=f"{dvrk}/set_robot_state",
                causality="input",
                type=_STRING,
                variability="event",
                description="echoed",
            )
            yield Port(name=self._state_topic, causality="output", type=_STRING, variability="event")
        if self._jaw is not None:
            yield Port(
                name=f"{dvrk}/state_jaw_desired",
                causality="input",
                type=_JOINT_STATE,
                variability="event",
                description="of half the opening",
            )
            yield _measured(f"{name}/jaw/measured_js", (self._jaw.name,))
            yield Port(
                name=f"{name}/jaw/servo_jp", causality="output", type=_JOINT_STATE, names=(self._jaw.name,)
            )
            yield Port(
                name=f"{dvrk}/state_jaw_current",
                causality="output",
                type=_JOINT_STATE,
                description="half the opening",
            )

    def step(self, inputs: Inputs, *, release: bool) -> dict[str, Value]:
        """Heed what has arrived, and tell what is measured."""
        dvrk, n = f"dvrk/{self._name}", len(self._joints)
        for topic in _DESIRED:
            for wish in cast("tuple[JointState, ...]", inputs.events(f"{dvrk}/{topic}")):
                if _fits(wish, n):
                    self._desired[:] = np.clip(wish.position * self._scale, self._lower, self._upper)
        measured = inputs[f"{self._name}/measured_js"]
        self._current[:n], self._current[n:] = measured[:n] / self._scale, measured[n : 2 * n] / self._scale
        if self._state_topic:
            self.outputs[self._state_topic] = self._words(inputs)
        if self._jaw is not None:
            for wish in cast("tuple[JointState, ...]", inputs.events(f"{dvrk}/state_jaw_desired")):
                if _fits(wish, 1):
                    self._open(2.0 * _HALF_ANGLE * max(float(wish.position[0]), 0.0))
            if release:
                self._open(_OPEN)
            self._jaw_current[0] = 0.5 * inputs[f"{self._name}/jaw/measured_js"][0]
        return self.outputs

    def _words(self, inputs: Inputs) -> tuple[StringMessage, ...]:
        """Return the word at the start, and those that are echoed."""
        first = () if self._told[0] else (StringMessage(data=_STATES[self._name][1]),)
        self._told[0] = 1.0
        return (
            *first,
            *cast("tuple[StringMessage, ...]", inputs.events(f"dvrk/{self._name}/set_robot_state")),
        )

    def _open(self, opening: float) -> None:
        if self._jaw is not None:
            self._jaw_desired[0] = min(max(opening, self._jaw.lower), self._jaw.upper)


def _measured(name: str, names: tuple[str, ...]) -> Port:
    still = (0.0,) * (3 * len(names))
    return Port(
        name=name,
        causality="input",
        type=_JOINT_STATE,
        names=names,
        fields=("position", "velocity", "effort"),
        start=still,
    )


def _fits(wish: JointState, count: int) -> bool:
    """Say whether a wish has as many positions as there are joints, and all are numbers; others are dropped,
    as there is nobody to tell.
    """
    return wish.position.size == count and bool(np.isfinite(wish.position).all())


def _set(stated: SetupJoints, arm: CartArm) -> Vector:
    return np.array(getattr(stated, arm) or setup_joints.SIMULATED[arm])
