"""The topics of the V-REP scenes of Ferro et al., over a robot simulated here.

Programs written for "A Portable da Vinci Simulator in Virtual Reality", 2019, run unchanged: names,
sizes and mappings are those of the scripts of its scenes (unina-icaros/dvrk-vrep, 88fe5975). Ports are named
as the topics. As there, desired joint positions go to the joints without a motion controller: here to their
servos, clipped to the joints' ranges. States are words echoed without effect.

docs/decisions/0032 lists the differences.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.motion.params import Arms, EcmParams, PsmParams, SetupJoints
from controllers.ports import measured_joints
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    Value,
    array,
    event_in,
    event_out,
    flag,
    number,
    signal_out,
)
from robots.dvrk import setup_joints
from robots.dvrk.setup_joints import CartArm
from schemas.ports import Port
from schemas.ros import BoolMessage, JointState, StringMessage
from schemas.vectors import Vector

__all__ = ["VrepScene", "VrepSceneParams"]

_HALF_ANGLE = 0.4106
"""rad of half the jaw's opening per unit of a command."""
_WRIST_YAW = {"PSM2": 0.8212}
"""Scale of the last joint of an arm."""
_OPEN = 2.0 * _HALF_ANGLE
"""rad; opening of a jaw that releases a needle: that of command 1, our choice."""
_STATES = {
    "PSM1": ("current_state", "READY"),
    "PSM2": ("robot_state", "uninitialized"),
    "PSM3": ("robot_state", "uninitialized"),
}
"""Name of the topic, and the word at the start; the authors' scenes have no PSM3."""
_DESIRED = ("state_joint_desired", "set_position_joint", "set_position_goal_joint")
"""Topics of desired joint positions.

The first is that of most scenes, the second of the authors' Python client, the third of the scenes of
tracking and servoing.
"""
_SETUP: tuple[tuple[CartArm, int], ...] = (("PSM1", 5), ("PSM2", 5), ("ECM", 4))
"""Right, left, camera: how many of their setup joints are published, the lift first."""


class VrepSceneParams(Params):
    """Which arms there are, as the scenario states them for the robot."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    setup_joints: SetupJoints = Field(
        default=SetupJoints(), description="their positions, as the scenario states them for the robot"
    )


class VrepScene(Controller):
    """Reads desired positions, jaws and words under `dvrk/`; publishes states there.

    The robot gets `servo_jp`.
    """

    params_model: ClassVar[type[Params]] = VrepSceneParams
    params: VrepSceneParams

    def __init__(self, name: str, params: VrepSceneParams) -> None:
        super().__init__(name, params)
        self._arms = [_Arm(name, arm) for name, arm in params.arms.present_arms.items()]
        self.keep(*(arm.state for arm in self._arms))
        stated = params.setup_joints
        self._setup = np.concatenate([_set(stated, arm)[:count] for arm, count in _SETUP])

    @property
    def ports(self) -> tuple[Port, ...]:
        """The topics of the scene, and the robot's own ports."""
        return (
            *(port for arm in self._arms for port in arm.ports),
            event_in("release_needle", BoolMessage, "true: every jaw opens"),
            signal_out(
                "dvrk/setup_joint/state_joint_current",
                JointState,
                "right, left, camera",
                size=self._setup.size,
            ),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start where the parameters state it."""
        outputs: dict[str, Value] = {"dvrk/setup_joint/state_joint_current": self._setup}
        return outputs | {port: value for arm in self._arms for port, value in arm.outputs.items()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Pass on what is desired and what is measured."""
        release = any(
            message.data for message in cast("tuple[BoolMessage, ...]", inputs.events("release_needle"))
        )
        outputs: dict[str, Value] = {"dvrk/setup_joint/state_joint_current": self._setup}
        for arm in self._arms:
            outputs |= arm.step(inputs, release=release)
        return outputs


class _ArmState(Record):
    desired = array("n")
    current = array(2, "n")
    """Positions and velocities as published."""
    jaw_desired = number()
    """Opening, rad."""
    jaw_current = number()
    """Half the opening as published."""
    published = flag()
    """Whether the first word was published."""


class _Arm:
    """An arm."""

    def __init__(self, name: CartArm, params: PsmParams | EcmParams) -> None:
        self._name, self._joints = name, params.chain.joints
        self._lower, self._upper = params.chain.lower, params.chain.upper
        jaw = params.tool.jaw if isinstance(params, PsmParams) else None
        self._jaw = None if jaw is None else jaw.joint
        self._scale = np.ones(len(self._joints))
        self._scale[-1] = _WRIST_YAW.get(name, 1.0)
        n = len(self._joints)
        self.state = _ArmState(n=n)
        self._desired, self._current = self.state.desired, self.state.part("current")
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
            self.state.jaw_desired = params.jaw
            self.state.jaw_current = 0.5 * params.jaw / (_HALF_ANGLE if name == "PSM1" else 1.0)
            self.outputs |= {
                f"{name}/jaw/servo_jp": self.state.part("jaw_desired"),
                f"{dvrk}/state_jaw_current": self.state.part("jaw_current"),
            }

    @property
    def ports(self) -> Iterator[Port]:
        name, dvrk, names = self._name, f"dvrk/{self._name}", tuple(joint.name for joint in self._joints)
        for topic in _DESIRED:
            yield event_in(f"{dvrk}/{topic}", JointState, "set directly")
        yield measured_joints(f"{name}/measured_js", names, start=())
        yield signal_out(f"{name}/servo_jp", JointState, names=names)
        yield signal_out(
            f"{dvrk}/state_joint_current", JointState, size=len(names), fields=("position", "velocity")
        )
        if self._state_topic:
            yield event_in(f"{dvrk}/set_robot_state", StringMessage, "echoed")
            yield event_out(self._state_topic, StringMessage)
        if self._jaw is not None:
            yield event_in(f"{dvrk}/state_jaw_desired", JointState, "of half the opening")
            yield measured_joints(f"{name}/jaw/measured_js", (self._jaw.name,), start=())
            yield signal_out(f"{name}/jaw/servo_jp", JointState, names=(self._jaw.name,))
            yield signal_out(f"{dvrk}/state_jaw_current", JointState, "half the opening")

    def step(self, inputs: Inputs, *, release: bool) -> dict[str, Value]:
        """Read what is desired, and publish what is measured."""
        dvrk, n = f"dvrk/{self._name}", len(self._joints)
        for topic in _DESIRED:
            for desired in cast("tuple[JointState, ...]", inputs.events(f"{dvrk}/{topic}")):
                if _fits(desired, n):
                    self._desired[:] = np.clip(desired.position * self._scale, self._lower, self._upper)
        measured = inputs[f"{self._name}/measured_js"]
        self._current[:n], self._current[n:] = measured[:n] / self._scale, measured[n : 2 * n] / self._scale
        if self._state_topic:
            self.outputs[self._state_topic] = self._words(inputs)
        if self._jaw is not None:
            for desired in cast("tuple[JointState, ...]", inputs.events(f"{dvrk}/state_jaw_desired")):
                if _fits(desired, 1):
                    self._open(2.0 * _HALF_ANGLE * max(float(desired.position[0]), 0.0))
            if release:
                self._open(_OPEN)
            self.state.jaw_current = 0.5 * float(inputs[f"{self._name}/jaw/measured_js"][0])
        return self.outputs

    def _words(self, inputs: Inputs) -> tuple[StringMessage, ...]:
        """Return the first word at the start, and those echoed."""
        first = () if self.state.published else (StringMessage(data=_STATES[self._name][1]),)
        self.state.published = True
        return (
            *first,
            *cast("tuple[StringMessage, ...]", inputs.events(f"dvrk/{self._name}/set_robot_state")),
        )

    def _open(self, opening: float) -> None:
        if self._jaw is not None:
            self.state.jaw_desired = min(max(opening, self._jaw.lower), self._jaw.upper)


def _fits(desired: JointState, count: int) -> bool:
    """Return whether a message has `count` finite positions; others are dropped: no topic is for errors."""
    return desired.position.size == count and bool(np.isfinite(desired.position).all())


def _set(stated: SetupJoints, arm: CartArm) -> Vector:
    return np.array(getattr(stated, arm) or setup_joints.SIMULATED[arm])
