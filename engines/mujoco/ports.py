"""The ports of the MuJoCo engine, with CRTK's names where CRTK has one."""

from __future__ import annotations

from collections.abc import Iterator

from engines.mujoco.object_params import NeedleParams
from engines.mujoco.params import MujocoParams, SceneParams, has_jaw, has_probe, has_spheres
from robots.dvrk import ecm
from robots.dvrk.linkage import LINKAGES
from robots.dvrk.mounted import MountedEcm, MountedPsm
from robots.dvrk.rolling_needle_driver import PADS
from schemas.ports import BondSide, Port
from schemas.ros import Float64Message, JointState, PoseStamped, WrenchStamped

__all__ = ["WIRE", "bond_sides", "position_count", "scene_ports"]

_JOINT_STATE, _POSE, _WRENCH = JointState.ros_type, PoseStamped.ros_type, WrenchStamped.ros_type
_ALL = ("position", "velocity", "effort")
_MODES = (
    "[arm, jaw or hand]: 0 off (the ECM's brakes hold), 1 position servo, 2 effort; 3 and 4 the last two"
    " without gravity compensation"
)
WIRE = "wire"
"""Of a needle: the bond at three points of it."""
_FREE_BODY = 7
"""Position and quaternion."""


def scene_ports(params: MujocoParams) -> tuple[Port, ...]:
    """Return all ports but those of bonds."""
    slow = params.publish_period
    ports = [
        port
        for name, arm in params.arms.items()
        for port in (*_arm_ports(name, arm, params), *_jaw_ports(name, arm), *_hand_ports(name, arm))
    ]
    size = position_count(params)
    ports.append(
        Port(
            name="qpos",
            causality="output",
            size=size,
            period_ns=slow,
            description="joint positions of the whole model, as MuJoCo has them",
        )
    )
    if params.fixtures and params.rigid_wrench:
        ports += _collision_ports(slow)
    return (*ports, *(port for name in params.objects for port in _object_ports(name, slow)))


def _collision_ports(slow: int) -> Iterator[Port]:
    for what, meaning in (
        ("tools", "of all contacts between instruments of different arms since the start"),
        (
            "fixtures",
            "of all contacts between instruments and boards, posts, walls and dishes since the start",
        ),
    ):
        yield Port(
            name=f"{what}/impulse",
            causality="output",
            type=Float64Message.ros_type,
            unit="N*s",
            period_ns=slow,
            description=meaning,
        )


def bond_sides(params: MujocoParams) -> tuple[BondSide, ...]:
    """Return the bonds `<arm>/probe` of palpation probes and `<arm>/contact` of contact spheres.

    Needles have `<needle>/wire`: base, middle and tip of the wire. All are in the world.
    """
    needles = (name for name, thing in params.objects.items() if isinstance(thing, NeedleParams))
    return (
        *(side for name, arm in params.arms.items() for side in _arm_bonds(name, arm)),
        *(BondSide(name=f"{name}/{WIRE}", side="motion", dof=3, points=3, frame="world") for name in needles),
    )


def _arm_bonds(name: str, arm: MountedPsm | MountedEcm) -> Iterator[BondSide]:
    if has_probe(arm):
        yield BondSide(name=f"{name}/probe", side="motion", frame="world")
    if isinstance(arm, MountedPsm) and (spheres := arm.tool.spheres):
        yield BondSide(name=f"{name}/contact", side="motion", dof=3, points=len(spheres), frame="world")


def _arm_ports(arm: str, params: MountedPsm | MountedEcm, engine: MujocoParams) -> Iterator[Port]:
    slow = engine.publish_period
    names = tuple(joint.name for joint in params.chain.joints)
    still = (0.0,) * len(names)
    yield Port(
        name=f"{arm}/servo_jp",
        causality="input",
        type=_JOINT_STATE,
        names=names,
        start=params.start,
        description="goal of the joint servos",
    )
    yield Port(
        name=f"{arm}/servo_jf",
        causality="input",
        type=_JOINT_STATE,
        names=names,
        fields=("effort",),
        start=still,
        description="acts in effort mode",
    )
    yield Port(name=f"{arm}/control_mode", causality="input", size=2, start=(1.0, 1.0), description=_MODES)
    yield Port(name=f"{arm}/measured_js", causality="output", type=_JOINT_STATE, names=names, fields=_ALL)
    yield Port(name=f"{arm}/setpoint_js", causality="output", type=_JOINT_STATE, names=names, period_ns=slow)
    yield Port(name=f"{arm}/measured_cp", causality="output", type=_POSE, frame=f"{arm}_base", period_ns=slow)
    if has_probe(params) or has_spheres(params):
        felt = (
            "mean over the last step of the force through the bonds on the instrument, with its moment about"
            " the tip: what a haptic device feels"
        )
        yield Port(
            name=f"{arm}/tip_wrench", causality="output", type=_WRENCH, frame=f"{arm}_base", description=felt
        )
    if isinstance(params, MountedPsm) and engine.rigid_wrench:
        felt = (
            "the same of rigid contacts: table, objects, cart, other arms; an object in the jaws pulls with"
            " its weight"
        )
        yield Port(
            name=f"{arm}/rigid_wrench",
            causality="output",
            type=_WRENCH,
            frame=f"{arm}_base",
            description=felt,
        )


def _jaw_ports(arm: str, params: MountedPsm | MountedEcm) -> Iterator[Port]:
    if isinstance(params, MountedPsm) and has_jaw(params):
        names = tuple(joint.name for joint in params.tool.jaw_joints)
        start, still = (params.jaw, 0.0)[: len(names)], (0.0,) * len(names)
        goal = "goal of the jaw's servo" + (
            ""
            if params.tool.roller is None
            else ", and by how much the pads are to roll a needle of 0.8 mm between them"
        )
        yield Port(
            name=f"{arm}/jaw/servo_jp",
            causality="input",
            type=_JOINT_STATE,
            names=names,
            start=start,
            description=goal,
        )
        yield Port(
            name=f"{arm}/jaw/servo_jf",
            causality="input",
            type=_JOINT_STATE,
            names=names,
            fields=("effort",),
            start=still,
            description="acts in effort mode",
        )
        yield Port(
            name=f"{arm}/jaw/measured_js", causality="output", type=_JOINT_STATE, names=names, fields=_ALL
        )


def _hand_ports(arm: str, params: MountedPsm | MountedEcm) -> Iterator[Port]:
    if isinstance(params, MountedPsm) and (hand := params.tool.hand) is not None:
        names, still = tuple(motor.name for motor in hand.joints), (0.0,) * len(hand.joints)
        goal = "goal of closings and spreads"
        yield Port(
            name=f"{arm}/hand/servo_jp",
            causality="input",
            type=_JOINT_STATE,
            names=names,
            start=params.hand,
            description=goal,
        )
        yield Port(
            name=f"{arm}/hand/servo_jf",
            causality="input",
            type=_JOINT_STATE,
            names=names,
            fields=("effort",),
            start=still,
            description="acts in effort mode",
        )
        closing = "closings of the fingers and positions of their first joints, and the torques of the motors"
        yield Port(
            name=f"{arm}/hand/measured_js",
            causality="output",
            type=_JOINT_STATE,
            names=names,
            fields=_ALL,
            description=closing,
        )
        bones = tuple(link.name for link in hand.links)
        yield Port(
            name=f"{arm}/hand/phalanges/measured_js",
            causality="output",
            type=_JOINT_STATE,
            names=bones,
            fields=_ALL,
            description="of each joint",
        )


def _object_ports(thing: str, slow: int) -> Iterator[Port]:
    yield Port(
        name=f"{thing}/place",
        causality="input",
        type=_POSE,
        frame="world",
        variability="event",
        description="puts it there, at rest",
    )
    yield Port(name=f"{thing}/pose", causality="output", type=_POSE, frame="world", period_ns=slow)
    holder = "number of the PSM whose jaws hold it (the first, where two hold it), 0 while none does"
    yield Port(
        name=f"{thing}/held_by",
        causality="output",
        type=Float64Message.ros_type,
        period_ns=slow,
        description=holder,
    )
    slip = "how far it has moved in the jaws that hold it since they closed"
    yield Port(
        name=f"{thing}/slip",
        causality="output",
        type=Float64Message.ros_type,
        unit="m",
        period_ns=slow,
        description=slip,
    )
    turn = "angle by which it has turned in the jaws that hold it since they closed, at most half a turn"
    yield Port(
        name=f"{thing}/turn",
        causality="output",
        type=Float64Message.ros_type,
        unit="rad",
        period_ns=slow,
        description=turn,
    )
    yield Port(
        name=f"{thing}/lift",
        causality="output",
        type=Float64Message.ros_type,
        unit="m",
        period_ns=slow,
        description="height over where it started",
    )


def position_count(scene: SceneParams) -> int:
    """Return the size of `qpos`, without building the model.

    It has the joints, linkage and fingers with pads or phalanges of every arm, then the pose of every object.
    """
    count = _FREE_BODY * len(scene.objects)
    for name, arm in scene.arms.items():
        if isinstance(arm, MountedEcm):
            count += len(ecm.JOINT_NAMES)
        else:
            tool = arm.tool
            count += (
                len(arm.chain.joints)
                + (0 if tool.jaw is None else 2)
                + (0 if tool.hand is None else len(tool.hand.links))
            )
            count += 0 if tool.roller is None else len(PADS)
        count += len(LINKAGES[name].joints)
    return count
