"""Actions of a learning environment: so much of a tip's displacement, turn and jaw at a time.

An action has five numbers of -1 to 1 for each hand: displacement of the tip along x, y and z of the world, a
turn, and the jaw, which closes below 0 and opens from 0 on, as in SurRoL (med-air/SurRoL at a903fa6,
surrol/tasks/psm_env.py: 10 mm, 30 degrees of yaw or 15 of pitch, jaw 40 degrees or shut in a step of 0.2 s);
an electrode has no jaw, and power below 0. What is out of range is clipped. The tip's goal moves by the
action and stays inside the workspace; the joints go there evenly within the step. A goal that the arm cannot
reach is not taken, and counted.

Alternatively (`control: tip`) an action has eight numbers for each hand: the goal of the tip in the world (m,
quaternion x, y, z, w) and the opening of the jaw (rad), or the power of an electrode (W). The goal moves
there by no more than `displacement` and `turn`, and the joints at even speed, as rows of a policy follow one
another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from controllers.least_jerk import least_jerk
from controllers.motion.frames import base_in_world
from controllers.motion.joint_errors import JointErrors
from controllers.motion.params import Arms, PsmParams, SetupJoints
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    integer,
    number,
    signal_in,
    signal_out,
)
from robots import rotation
from robots.dvrk.crtk import Mounting
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.jaw import Jaw
from robots.dvrk.inverse import inverse
from robots.dvrk.parameters import ArmName
from robots.transform import inverse_transform, matrix_to_pose, rigid_transform
from schemas.errors import MotionError, ScenarioError
from schemas.ports import Port
from schemas.quantity import Angle, Duration, Length, Power
from schemas.ros import Float64Message, JointState, PoseStamped
from schemas.vectors import Vector

__all__ = ["Actions", "ActionsParams"]

_NUMBERS = {"displacement": 5, "tip": 8}
"""Numbers in an action of a hand."""
_SHORTEST = 0.1
"""Norm of a quaternion below which no orientation can be read."""
_Point = tuple[Length, Length, Length]
_Angle = Annotated[Angle, Field(gt=0.0)]


class ActionsParams(Params):
    """Which hands act, how far an action goes, and where the tips may be."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = "free"
    setup_joints: SetupJoints = SetupJoints()
    hands: tuple[ArmName, ...] = Field(default=("PSM1",), min_length=1, description="in the action's order")
    control: Literal["displacement", "tip"] = Field(
        default="displacement",
        description="what an action is: a displacement and turn, or the tip's goal",
    )
    action_step: Duration = Field(
        default=200_000_000, gt=0, description="time between two actions; a multiple of the period"
    )
    first_action: Duration = Field(
        default=0, ge=0, description="when the first action is due; the arms stay until then"
    )
    displacement: Annotated[Length, Field(gt=0.0)] = Field(
        default=10e-3, description="of a tip by an action of 1, along each axis of the world"
    )
    turn: _Angle = Field(default=radians(30.0), description="by an action of 1; of pitch, the half of it")
    turn_about: Literal["yaw", "pitch"] = Field(
        default="yaw", description="the world's z axis, or the tip's own x axis"
    )
    opening: _Angle = Field(default=radians(40.0), description="of a jaw that is open")
    closing: Annotated[Angle, Field(le=0.0)] = Field(
        default=0.0,
        description=(
            "of a jaw that is shut: at 0 a wire of 0.8 mm is pressed with a fraction of the jaw's largest"
            " torque, which is what sub-steps of 2 ms can hold"
        ),
    )
    power: Annotated[Power, Field(gt=0.0, le=400.0)] = Field(
        default=30.0, description="of the generator of an electrode without a jaw, while it is on"
    )
    workspace: tuple[_Point, _Point] = Field(
        description="two opposite corners, in the world, between which the goals of the tips stay"
    )
    joint_errors: JointErrors = Field(
        default=JointErrors(), description="of the arms' encoders, unknown to whoever acts"
    )

    @model_validator(mode="after")
    def _has_its_hands(self) -> Self:
        if missing := [arm for arm in self.hands if arm not in self.arms.present_arms]:
            raise ValueError(f"hands: {', '.join(missing)} is no arm of the scene")
        return self


class _HandState(Record):
    goal = array(7)
    """Pose of the tip in the world that the joints go to: m, quaternion (x, y, z, w)."""
    start = array("joints")
    end = array("joints")
    """Positions between which the joints go, rad and m."""
    command = array("joints")
    jaw_start = number()
    jaw_end = number()
    """Openings between which the jaw goes, rad."""
    jaw = array(1)
    refused = array(1)
    """Goals that could not be reached."""


class _Hand:
    """An arm."""

    def __init__(self, arm: ArmName, params: ActionsParams, held: PsmParams) -> None:
        self.base = base_in_world(arm, params)
        self.arm, self.chain, self.params = arm, held.chain, params
        self.power = np.zeros(1 if isinstance(held.tool.end_effector, Electrode) else 0)
        """Power of an electrode, W, shape (1,); empty with a jaw."""
        corners = np.array(params.workspace)
        self.low, self.high = corners.min(axis=0), corners.max(axis=0)
        self._into_base = inverse_transform(self.base)
        self.state = now = _HandState(joints=len(held.chain.joints))
        now.start[:] = now.end[:] = now.command[:] = held.start
        now.goal[:] = matrix_to_pose(self.base @ self.chain.frames(now.start)[-1])
        now.jaw[0] = now.jaw_start = now.jaw_end = held.jaw
        self.offsets = params.joint_errors.of(arm, len(held.chain.joints))
        """True minus measured joint positions, rad and m."""
        # without offsets the command itself is the output, to the bit
        self.servo = now.command + self.offsets if self.offsets.any() else now.command

    def act(self, action: Vector) -> None:
        """Begin to go where an action, shape (5,), of -1 to 1, leads."""
        now, params = self.state, self.params
        position = np.clip(now.goal[:3] + params.displacement * action[:3], self.low, self.high)
        if params.turn_about == "yaw":
            about = np.array([0.0, 0.0, params.turn * float(action[3])])
            orientation = rotation.product(rotation.exp(about), now.goal[3:])
        else:
            about = np.array([0.5 * params.turn * float(action[3]), 0.0, 0.0])
            orientation = rotation.product(now.goal[3:], rotation.exp(about))
        self.power[:] = params.power if action[4] < 0.0 else 0.0
        now.jaw_start = float(now.jaw[0])
        now.jaw_end = params.opening if action[4] >= 0.0 else params.closing
        self._go_to(position, orientation)

    def follow(self, action: Vector) -> None:
        """Begin to go to a goal of the tip, with a jaw opening or a power, shape (8,)."""
        now, params = self.state, self.params
        self.power[:] = min(max(float(action[7]), 0.0), params.power)
        now.jaw_start = float(now.jaw[0])
        now.jaw_end = min(max(float(action[7]), params.closing), params.opening)
        way, norm = action[:3] - now.goal[:3], float(np.linalg.norm(action[3:7]))
        if norm < _SHORTEST:
            now.refused[0] += 1.0
            now.start[:] = now.command
            return
        way *= params.displacement / max(float(np.linalg.norm(way)), params.displacement)
        turn = rotation.log(rotation.product(action[3:7] / norm, rotation.conjugate(now.goal[3:])))
        turn *= params.turn / max(float(np.linalg.norm(turn)), params.turn)
        orientation = rotation.product(rotation.exp(turn), now.goal[3:])
        self._go_to(np.clip(now.goal[:3] + way, self.low, self.high), orientation)

    def _go_to(self, position: Vector, orientation: Vector) -> None:
        now = self.state
        tip = rigid_transform(rotation.matrix(orientation), position)
        now.start[:] = now.command
        try:
            now.end[:] = inverse(self.chain, self._into_base @ tip, now.command)
        except MotionError:
            now.refused[0] += 1.0
            return
        now.goal[:3], now.goal[3:] = position, orientation / np.linalg.norm(orientation)

    def go(self, share: float) -> None:
        """Command what is due after this share of the step's time."""
        now = self.state
        now.jaw[0] = now.jaw_start + share * (now.jaw_end - now.jaw_start)
        now.command[:] = now.start + self._curve(share) * (now.end - now.start)

    def _curve(self, share: float) -> float:
        """Return the share of the way: smooth from rest to rest, or even between the goals of a policy."""
        if self.params.control == "tip":
            return share
        return least_jerk(share)

    def series(self, shares: Sequence[float]) -> tuple[Vector, Vector]:
        """Return joints, shape (n, joints), and jaw, shape (n, 1), at shares of the step's time; end there.

        The bits are those of `go`, share by share.
        """
        now = self.state
        part = np.array(shares)[:, None]
        curve = np.array([self._curve(share) for share in shares])[:, None]
        jaws = now.jaw_start + part * (now.jaw_end - now.jaw_start)
        commands = now.start + curve * (now.end - now.start)
        now.jaw[:], now.command[:] = jaws[-1], commands[-1]
        return commands, jaws


class _Progress(Record):
    periods = integer()
    """Since time 0."""


class Actions(Controller):
    """Leads arms, jaws and generators by actions."""

    params_model: ClassVar[type[Params]] = ActionsParams
    params: ActionsParams

    def __init__(self, name: str, params: ActionsParams) -> None:
        super().__init__(name, params)
        self._hands: list[_Hand] = []
        for arm in params.hands:
            held = params.arms.present_arms[arm]
            if not isinstance(held, PsmParams) or not isinstance(held.tool.end_effector, Jaw | Electrode):
                raise ScenarioError(
                    f"{arm} holds no instrument with a jaw or an electrode", path=("participants", name)
                )
            self._hands.append(_Hand(arm, params, held))
        self._progress = _Progress()
        powers = [hand.power for hand in self._hands if hand.power.size]
        self.keep(self._progress, *(hand.state for hand in self._hands), *powers)
        self._outputs: dict[str, Any] = {}
        for hand in self._hands:
            self._outputs[f"{hand.arm}/servo_jp"] = hand.servo
            if hand.power.size:
                self._outputs[f"{hand.arm}/energy"] = hand.power
            else:
                self._outputs[f"{hand.arm}/jaw/servo_jp"] = hand.state.jaw
            self._outputs[f"{hand.arm}/goal_cp"] = hand.state.goal
            self._outputs[f"{hand.arm}/refused"] = hand.state.refused

    @property
    def ports(self) -> tuple[Port, ...]:
        """The action in; goals of joints, jaw and tip, power, and the number of goals out of reach, out."""
        count = _NUMBERS[self.params.control] * len(self._hands)
        action = signal_in(
            "action",
            description=(
                "of each hand x, y, z, turn and jaw, from -1 to 1"
                if self.params.control == "displacement"
                else "of each hand the tip's pose in the world and the jaw opening: m, quaternion, rad"
            ),
            size=count,
            start=(0.0,) * count,
        )
        return (action, *(port for hand in self._hands for port in _ports(hand)))

    def configure(self, setup: Setup) -> Outputs:
        """Stay where the arms start. Raises ScenarioError if the period does not divide an action's step."""
        self._count, rest = divmod(self.params.action_step, setup.period_ns)
        if rest:
            raise ScenarioError(
                f"action_step {self.params.action_step} ns is no multiple of the period {setup.period_ns} ns",
                path=("participants", self.name, "action_step"),
            )
        self._wait = -(-self.params.first_action // setup.period_ns)
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Take the action when one is due, and go a part of the way."""
        periods = self._progress.periods - self._wait
        self._progress.periods += 1
        if periods < 0:
            return self._through_encoders()
        part = periods % self._count
        if part == 0:
            self._act(inputs)
        for hand in self._hands:
            hand.go((part + 1) / self._count)
        return self._through_encoders()

    def _through_encoders(self) -> Outputs:
        for hand in self._hands:
            if hand.servo is not hand.state.command:
                np.add(hand.state.command, hand.offsets, out=hand.servo)
        return self._outputs

    @property
    def has_joint_errors(self) -> bool:
        """Whether the encoders of a hand have offsets."""
        return any(hand.offsets.any() for hand in self._hands)

    def measured_tip(self, arm: str, q: Vector) -> Vector:
        """Return the pose of the tip of `arm` in the world, shape (7,), as encoders tell at true `q`."""
        hand = next(hand for hand in self._hands if hand.arm == arm)
        return matrix_to_pose(hand.base @ hand.chain.frames(q - hand.offsets)[-1])

    def _act(self, inputs: Inputs) -> None:
        rows = inputs["action"].reshape(len(self._hands), -1)
        for hand, row in zip(self._hands, rows, strict=True):
            if self.params.control == "displacement":
                hand.act(np.clip(row, -1.0, 1.0))
            else:
                hand.follow(row)

    def leap(
        self,
        t: int,
        h: int,
        count: int,
        inputs: Inputs,
        series: Mapping[str, Vector],  # noqa: ARG002
    ) -> tuple[Outputs, Mapping[str, Vector]]:
        """Take several steps; return the commands of each, the goals of the last."""
        made: list[Mapping[str, Vector]] = []
        while count:
            part = (self._progress.periods - self._wait) % self._count
            waits = self._progress.periods < self._wait
            run = 1 if waits else min(count, self._count - part)
            if waits:
                self.step(t, h, inputs)
            else:
                if part == 0:
                    self._act(inputs)
                self._progress.periods += run
            shares = () if waits else [(part + 1 + i) / self._count for i in range(run)]
            made.append(self._series(shares))
            count -= run
        return self._outputs, {name: np.concatenate([one[name] for one in made]) for name in made[0]}

    def _series(self, shares: Sequence[float]) -> dict[str, Vector]:
        """Return the commands after shares of the step's time; of the present, without any."""
        made: dict[str, Vector] = {}
        for hand in self._hands:
            now = hand.state
            joints, jaw = hand.series(shares) if shares else (now.command[None].copy(), now.jaw[None].copy())
            if hand.servo is not now.command:
                joints = joints + hand.offsets
                hand.servo[:] = joints[-1]
            made[f"{hand.arm}/servo_jp"] = joints
            if hand.power.size:
                made[f"{hand.arm}/energy"] = np.repeat(hand.power[None], len(joints), axis=0)
            else:
                made[f"{hand.arm}/jaw/servo_jp"] = jaw
        return made


def _ports(hand: _Hand) -> tuple[Port, ...]:
    names = tuple(joint.name for joint in hand.chain.joints)
    joints, goal, refused = f"{hand.arm}/servo_jp", f"{hand.arm}/goal_cp", f"{hand.arm}/refused"
    jaw = signal_out(f"{hand.arm}/jaw/servo_jp", JointState, names=("jaw",))
    energy = signal_out(f"{hand.arm}/energy", description="power of the generator", unit="W")
    return (
        signal_out(joints, JointState, names=names),
        energy if hand.power.size else jaw,
        signal_out(goal, PoseStamped, frame="world"),
        signal_out(refused, Float64Message, "goals out of reach, which were not taken"),
    )
