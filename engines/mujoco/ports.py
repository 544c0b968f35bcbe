"""The ports of the MuJoCo engine, with CRTK's names where there are any."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Literal

from engines.mujoco.object_params import NeedleParams
from engines.mujoco.params import MujocoParams, SceneParams
from hub.participant import event_in, signal_in, signal_out, tunable_in
from robots.dvrk.end_effectors.probe import Probe
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.mtm import DISPLAY_FRAME
from robots.dvrk.psm import ARM_JOINTS
from robots.serial_chain import Joint
from schemas.ports import COORDINATE_UNITS, BondSide, Port
from schemas.ros import Float64Message, JointState, PoseStamped, WrenchStamped

__all__ = ["GRAVITY", "WIRE", "bond_sides", "bonded_joints", "position_count", "scene_ports"]

_ALL = ("position", "velocity", "effort")
_MODES = (
    "[arm, jaw or hand]: 0 off (the ECM's brakes hold), 1 position servo, 2 effort; 3 and 4 the last two"
    " without gravity compensation"
)
WIRE = "wire"
"""Name of a needle's bond at three points of the wire."""
GRAVITY = "gravity"
_GRAVITY_M_PER_S2 = 9.81
"""MuJoCo's default."""
_MOST_GRAVITY_M_PER_S2 = 25.0
"""A little more than on Jupiter."""
_NO_POSE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_FREE_BODY = 7
"""Position and quaternion."""


def scene_ports(params: MujocoParams) -> tuple[Port, ...]:
    """Return all ports but the ports of bonds."""
    slow = params.publish_period
    ports = [
        port
        for name, arm in params.arms.items()
        for port in (*_arm_ports(name, arm, params), *_end_effector_ports(name, arm))
    ]
    meaning = "joint positions of the whole model, as MuJoCo has them"
    ports.append(signal_out("qpos", description=meaning, size=position_count(params), period_ns=slow))
    ports.append(
        tunable_in(
            GRAVITY,
            _GRAVITY_M_PER_S2,
            (0.0, _MOST_GRAVITY_M_PER_S2),
            "along -z of `world`, on objects and on arms without gravity compensation",
            unit="m/s^2",
        )
    )
    for arm, joint in bonded_joints(params):
        goal = "goal of the joint's drive: the command within the joint's range, no faster than it may move"
        unit = COORDINATE_UNITS[_coordinate(joint)][0]
        ports.append(signal_out(f"{arm}/{joint.name}/goal", Float64Message, goal, unit=unit))
    if params.fixtures and params.rigid_wrench:
        ports += _collision_ports(slow)
    return (*ports, *(port for name in params.objects for port in _object_ports(name, slow)))


def _collision_ports(slow: int) -> Iterator[Port]:
    since = "since the start"
    between = "of all contacts between instruments"
    for what, meaning in (
        ("tools", f"{between} of different arms {since}"),
        ("fixtures", f"{between} and boards, posts, walls and dishes {since}"),
    ):
        yield signal_out(f"{what}/impulse", Float64Message, meaning, unit="N*s", period_ns=slow)


def bond_sides(params: MujocoParams) -> tuple[BondSide, ...]:
    """Return the bonds `<arm>/probe` of palpation probes and `<arm>/contact` of contact spheres.

    A spare instrument has `<arm>/<spare>/contact`. Needles have `<needle>/wire`: base, middle and tip of the
    wire. All are in the world. A joint driven from outside has `<arm>/<joint>`.
    """
    needles = (name for name, thing in params.objects.items() if isinstance(thing, NeedleParams))
    return (
        *(side for name, arm in params.arms.items() for side in _arm_bonds(name, arm)),
        *(BondSide(name=f"{name}/{WIRE}", side="motion", dof=3, points=3, frame="world") for name in needles),
        *(
            BondSide(name=f"{arm}/{joint.name}", side="motion", dof=1, coordinate=_coordinate(joint))
            for arm, joint in bonded_joints(params)
        ),
    )


def bonded_joints(params: MujocoParams) -> Iterator[tuple[str, Joint]]:
    """Yield the joints driven through bonds, with their arms."""
    for arm, names in params.bonded_joints.items():
        joints = {joint.name: joint for joint in params.arms[arm].chain.joints}
        yield from ((arm, joints[name]) for name in names)


def _coordinate(joint: Joint) -> Literal["length", "angle"]:
    return "length" if joint.kind == "prismatic" else "angle"


def _arm_bonds(name: str, arm: MountedArm) -> Iterator[BondSide]:
    if isinstance(arm.end_effector, Probe):
        yield BondSide(name=f"{name}/probe", side="motion", frame="world")
    for owner, one in arm.by_owner(name).items():
        if spheres := one.spheres:
            yield BondSide(name=f"{owner}/contact", side="motion", dof=3, points=len(spheres), frame="world")


def _arm_ports(arm: str, params: AnyArm, engine: MujocoParams) -> Iterator[Port]:
    slow, base = engine.publish_period, f"{arm}_base"
    names = tuple(joint.name for joint in params.chain.joints)
    yield from _servo_ports(arm, names, params.start, "goal of the joint servos")
    yield signal_in(f"{arm}/control_mode", description=_MODES, size=2, start=(1.0, 1.0))
    if len(params.variants) > 1:
        engaged = "instrument in the arm: 0 the mounted one, 1 the first spare"
        yield signal_in(f"{arm}/instrument", Float64Message, engaged, start=(0.0,))
    yield signal_out(f"{arm}/measured_js", JointState, names=names, fields=_ALL)
    yield signal_out(f"{arm}/setpoint_js", JointState, names=names, period_ns=slow)
    yield signal_out(f"{arm}/measured_cp", PoseStamped, frame=base, period_ns=slow)
    if isinstance(params, MountedMtm):
        yield from _hand_ports(arm)
    if any(True for _ in _arm_bonds(arm, params)):
        felt = (
            "mean over the last step of the force through the bonds on the instrument, with its moment about"
            " the tip: what a haptic device feels"
        )
        yield signal_out(f"{arm}/tip_wrench", WrenchStamped, felt, frame=base)
    if isinstance(params, MountedPsm) and engine.rigid_wrench:
        felt = (
            "the same of rigid contacts: table, objects, cart, other arms; an object in the jaws pulls with"
            " its weight"
        )
        yield signal_out(f"{arm}/rigid_wrench", WrenchStamped, felt, frame=base)


def _hand_ports(arm: str) -> Iterator[Port]:
    where, firmly = (
        "pose of the hand on the gripper",
        "how firmly the hand holds the gripper: 0 not at all, 1",
    )
    felt = "what the hand feels, at the gripper"
    yield signal_in(f"{arm}/hand_cp", PoseStamped, where, frame=DISPLAY_FRAME, start=_NO_POSE)
    yield signal_in(f"{arm}/hand_grip", Float64Message, firmly, start=(0.0,))
    yield signal_out(f"{arm}/hand_cf", WrenchStamped, felt, frame=DISPLAY_FRAME)


def _servo_ports(owner: str, names: tuple[str, ...], start: tuple[float, ...], goal: str) -> Iterator[Port]:
    still = (0.0,) * len(names)
    yield signal_in(f"{owner}/servo_jp", JointState, goal, names=names, start=start)
    yield signal_in(
        f"{owner}/servo_jf", JointState, "acts in effort mode", names=names, fields=("effort",), start=still
    )


def _end_effector_ports(arm: str, params: MountedArm) -> Iterator[Port]:
    effector = params.commanded_end_effector
    if not effector.joints:
        return
    owner, names = f"{arm}/{effector.name}", tuple(joint.name for joint in effector.joints)
    start = params.end_effector_start or (0.0,) * len(names)
    yield from _servo_ports(owner, names, start, effector.goal)
    yield signal_out(f"{owner}/measured_js", JointState, effector.measured, names=names, fields=_ALL)
    for reading, links in groupby(params.end_effector_links, lambda link: link.reading):
        if reading:
            names = tuple(link.name for link in links)
            yield signal_out(
                f"{owner}/{reading}/measured_js", JointState, "of each joint", names=names, fields=_ALL
            )


def _object_ports(thing: str, slow: int) -> Iterator[Port]:
    yield event_in(f"{thing}/place", PoseStamped, "puts it there, at rest", frame="world")
    yield signal_out(f"{thing}/pose", PoseStamped, frame="world", period_ns=slow)
    held = "in the jaws that hold it since they closed"
    for name, unit, meaning in (
        (
            "held_by",
            "",
            "number of the PSM whose jaws hold it (the first, where two hold it), 0 while none does",
        ),
        ("slip", "m", f"how far it has moved {held}"),
        ("turn", "rad", f"angle by which it has turned {held}, at most half a turn"),
        ("lift", "m", "height over where it started"),
    ):
        yield signal_out(f"{thing}/{name}", Float64Message, meaning, unit=unit, period_ns=slow)


def position_count(scene: SceneParams) -> int:
    """Return the size of `qpos`, without building the model.

    The joints, linkage and end effector of every arm, then the pose of every object.
    """
    count = _FREE_BODY * len(scene.objects)
    for name, arm in scene.arms.items():
        count += len(arm.chain.joints) + len(LINKAGES[name].joints) + len(arm.end_effector_links)
        if len(arm.variants) > 1:  # each instrument has a seat
            own = [spare.chain.joints[len(ARM_JOINTS) :] for spare in arm.variants[1:]]
            count += len(arm.variants) + sum(map(len, own))
            count += sum(len(spare.end_effector_links) for spare in arm.variants[1:])
    return count
