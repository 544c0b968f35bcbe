"""One arm under the governor: readings, limits, commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import numpy as np

from controllers.clip_trigger import ClipTrigger
from controllers.governor.params import GovernorParams
from controllers.motion.params import PsmParams
from controllers.ports import NO_WRENCH, measured_joints
from hub.participant import Inputs, Record, Value, array, event_in, event_out, flag, signal_in
from robots import rotation
from robots.dvrk import crtk
from robots.dvrk.parameters import ArmName
from robots.policies.states import ArmReading
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import (
    EmptyMessage,
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Time,
    WrenchStamped,
)
from schemas.vectors import Vector

__all__ = ["GovernedArm"]

_RELEASE = 0.8
"""Share of the largest force below which an arm moves again."""


class _ArmState(Record):
    command = array("size")
    """Last command: pose or joints, then jaw."""
    moves = flag()
    """Whether the last step had a command."""
    ready = flag(start=True)
    """Whether the arm is ENABLED and homed."""
    pressed = flag()
    """Whether the force was too large, and is not yet small enough."""


class GovernedArm:
    """An arm that follows goals within limits."""

    def __init__(self, arm: ArmName, params: GovernorParams) -> None:
        held = cast("PsmParams", params.arms.present_arms[arm])
        self.name, self._params, self.chain = arm, params, held.chain
        self.frame = crtk.reference_frame(
            arm, params.arms.present_arms, params.mounting, params.contract.frame
        )
        self._in_tip_space = params.contract.space == "tip"
        joint = held.gripper.joints[0] if held.gripper is not None else held.chain.joints[0]
        self._jaw_range = params.jaw or (joint.lower, joint.upper)
        corners = np.array(params.workspace[arm]) if arm in params.workspace else None
        self._box = None if corners is None else (corners.min(axis=0), corners.max(axis=0))
        self.size = 8 if self._in_tip_space else len(self.chain.joints) + 1
        self._now = _ArmState(size=self.size)
        self._trigger = None if held.tool.clip is None else ClipTrigger()
        self._fires = False
        self.reading = ArmReading(np.zeros(len(self.chain.joints)), 0.0, np.zeros(7))
        self._force = 0.0

    @property
    def states(self) -> Iterator[Record]:
        """Records that are part of a saved state."""
        yield self._now
        if self._trigger is not None:
            yield self._trigger.state

    @property
    def ports(self) -> Iterator[Port]:
        """CRTK's states in, servo commands out; of a clip applier its clips too."""
        arm, age = self.name, self._params.max_age
        names = tuple(joint.name for joint in self.chain.joints)
        yield signal_in(f"{arm}/measured_cp", PoseStamped, frame=self.frame, max_age_ns=age)
        yield measured_joints(f"{arm}/measured_js", names, max_age_ns=age)
        yield measured_joints(f"{arm}/jaw/measured_js", ("jaw",), max_age_ns=age)
        yield signal_in(f"{arm}/body/measured_cf", WrenchStamped, start=NO_WRENCH)
        yield event_in(f"{arm}/operating_state", OperatingState)
        if self._in_tip_space:
            yield event_out(f"{arm}/servo_cp", PoseStamped, "the goal within the limits", frame=self.frame)
        else:
            yield event_out(f"{arm}/servo_jp", JointState, "the goal within the limits", names=names)
        yield event_out(f"{arm}/jaw/servo_jp", JointState, "the goal within the limits", names=("jaw",))
        if self._trigger is not None:
            yield event_out(f"{arm}/clip", EmptyMessage, "the jaw is shut, and was wide open before")

    def read(self, inputs: Inputs) -> None:
        """Note the measured values."""
        arm, now = self.name, self._now
        for state in cast("tuple[OperatingState, ...]", inputs.events(f"{arm}/operating_state")):
            now.ready = crtk.is_ready(state)
        joints = inputs[f"{arm}/measured_js"]
        self.reading.joints = joints[: len(self.chain.joints)].copy()
        self.reading.jaw = float(inputs[f"{arm}/jaw/measured_js"][0])
        self.reading.tip = inputs[f"{arm}/measured_cp"].copy()
        self._force = float(np.linalg.norm(inputs[f"{arm}/body/measured_cf"][:3]))
        if (most := self._params.force) is not None:
            now.pressed = self._force > (_RELEASE * most if now.pressed else most)

    def reason_to_hold(self, inputs: Inputs) -> str:
        """Return why the arm cannot follow now; empty: it can."""
        if not self._now.ready:
            return f"{self.name} is not enabled and homed"
        silent = [p for p in ("measured_cp", "measured_js") if inputs.stale(f"{self.name}/{p}")]
        if silent:
            return f"{self.name}/{silent[0]} is silent for more than {self._params.max_age / 1e6:g} ms"
        if self._now.pressed:
            return f"{self.name} meets {self._force:.3g} N, allowed are {self._params.force:g} N (force)"
        return ""

    def hold(self) -> None:
        """Command nothing: the arm stays at its last set-point."""
        self._now.moves = False
        self._fires = False

    def follow(self, goal: Vector, h: float) -> bool:
        """Bring the command nearer to a goal in a step of `h` seconds; return whether a limit acted."""
        now = self._now
        if not now.moves:
            now.moves = True
            pose = self.reading.tip if self._in_tip_space else self.reading.joints
            now.command[:] = *pose, self.reading.jaw
        before = now.command.copy()
        jaw = float(np.clip(goal[-1], *self._jaw_range))
        most = self._params.jaw_speed * h
        now.command[-1] += np.clip(jaw - now.command[-1], -most, most)
        self._fires = self._trigger is not None and self._trigger.fires(float(now.command[-1]), h)
        limited = self._follow_tip(goal, h) if self._in_tip_space else self._follow_joints(goal[:-1], h)
        return limited or jaw != goal[-1] or abs(jaw - before[-1]) > most

    def _follow_tip(self, goal: Vector, h: float) -> bool:
        now, params = self._now, self._params
        position = goal[:3] if self._box is None else np.clip(goal[:3], *self._box)
        way = position - now.command[:3]
        turn = rotation.log(rotation.product(goal[3:7], rotation.conjugate(now.command[3:7])))
        share = min(_share(way, params.speed * h), 1.0)
        turned = min(_share(turn, params.turn_speed * h), 1.0)
        now.command[:3] += share * way
        orientation = rotation.product(rotation.exp(turned * turn), now.command[3:7])
        now.command[3:7] = orientation / np.linalg.norm(orientation)
        return share < 1.0 or turned < 1.0 or bool((position != goal[:3]).any())

    def _follow_joints(self, goal: Vector, h: float) -> bool:
        """Go towards joint positions, all joints by the same share of their way."""
        now, params, chain = self._now, self._params, self.chain
        before = now.command[:-1].copy()
        within = np.clip(goal, chain.lower, chain.upper)
        way = within - before
        start, end = chain.forward(before), chain.forward(within)
        turn = rotation.log(rotation.from_matrix(start[:3, :3].T @ end[:3, :3]))
        tip_way = end[:3, 3] - start[:3, 3]
        share = min(
            1.0,
            _share(tip_way, params.speed * h),
            _share(turn, params.turn_speed * h),
            *(
                limit * h / abs(d)
                for limit, d in zip(chain.velocity.tolist(), way.tolist(), strict=True)
                if d
            ),
        )
        after = before + share * way
        if self._box is not None and not self._is_inside(after):
            return True
        now.command[:-1] = after
        return share < 1.0 or bool((within != goal).any())

    def _is_inside(self, joints: Vector) -> bool:
        """Return whether the tip at these joints is in the workspace.

        The base frame in the contract's frame follows from the measured pose and joints.
        """
        low, high = cast("tuple[Vector, Vector]", self._box)
        base = pose_to_matrix(self.reading.tip) @ inverse_transform(self.chain.forward(self.reading.joints))
        tip = matrix_to_pose(base @ self.chain.forward(joints))[:3]
        return bool((tip >= low).all() and (tip <= high).all())

    def commands(self, stamp_ns: int) -> dict[str, Value]:
        """Return the commands of this step, by port."""
        now, arm = self._now, self.name
        motion = f"{arm}/servo_cp" if self._in_tip_space else f"{arm}/servo_jp"
        jaw = f"{arm}/jaw/servo_jp"
        clip: dict[str, Value] = {}
        if self._trigger is not None:
            clip[f"{arm}/clip"] = (EmptyMessage(),) if self._fires else ()
        if not now.moves:
            return {motion: (), jaw: (), **clip}
        header = Header(stamp=Time.from_ns(stamp_ns), frame_id=self.frame)
        if self._in_tip_space:
            x, y, z, qx, qy, qz, qw = now.command[:7].tolist()
            pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
            message: Any = PoseStamped(header=header, pose=pose)
        else:
            message = JointState(header=header, position=now.command[:-1].copy())
        return {
            motion: (message,),
            jaw: (JointState(header=header, position=now.command[-1:].copy()),),
            **clip,
        }


def _share(way: Vector, most: float) -> float:
    """Return the share of a way that is `most` long; infinite for no way."""
    length = float(np.linalg.norm(way))
    return most / length if length else float("inf")
