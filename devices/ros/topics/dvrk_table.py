"""The table of a gateway with `profile: dvrk`: every topic and service of arms, console, pedals and cameras.

Sources: commands and events from robots.dvrk.crtk and robots.dvrk.console_topics; periodic states
and services from jhu-cisst/cisst-ros (commit 73aca61c, mts_ros_crtk_bridge_provided.cpp) and
jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68, ros/dvrk_robot/src/system_ROS.cpp and
core/components/code/mtsIntuitiveResearchKit{Arm,PSM,ECM,MTM,SUJ}.cpp); further needs of programs in Python
from jhu-dvrk/dvrk_python (a1b337b3) and crtk_python_client (33b4c387); cameras from
jhu-dvrk/dvrk-readthedocs (53699e4d, docs/pages/video/software/ros.rst); `markers` and `error` of a camera are
ours. All events are latched, as there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Unpack, get_args

from devices.ros.params import GatewayParams, Real
from devices.ros.topics.diagnostics import DIAGNOSTICS_ROW
from devices.ros.topics.row import Row
from hub.participant import SignalFields, event_in, event_out, signal_in, signal_out
from robots.dvrk import arms as dvrk
from robots.dvrk import crtk
from robots.dvrk.console_topics import PARTS, PEDALS, TELEOPERATION
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_mtm import MountedMtm
from robots.dvrk.setup_joints import CartArm, DrivenArm, joint_names
from schemas.crtk import StringStamped
from schemas.ros import (
    CameraInfo,
    CompressedImage,
    Float64Message,
    Float64MultiArray,
    Image,
    JointState,
    PointStamped,
    PoseStamped,
    StringMessage,
    TFMessage,
)
from schemas.visualization import MarkerArray

__all__ = ["NOT_SERVED", "dvrk_table"]

NOT_SERVED = {
    "actuator_to_joint_position": "a simulated arm has no actuators whose encoders a program could read",
    "setpoint_cv": "the real bridge does not publish it either",
}
"""Names of the real system left out here, each with the reason."""

_FORWARD, _INVERSE = "crtk_msgs/srv/QueryForwardKinematics", "crtk_msgs/srv/QueryInverseKinematics"
_SERVICES = {
    "forward_kinematics": _FORWARD,
    "local/forward_kinematics": _FORWARD,
    "inverse_kinematics": _INVERSE,
}
_CARTESIAN_STATES = {name: type_ for name, type_ in crtk.CARTESIAN_STATES.items() if name not in NOT_SERVED}
_PICTURES = {"image_raw": Image.ros_type, "image_raw/compressed": CompressedImage.ros_type}
_TRUTH = {
    **dict.fromkeys(
        ("depth", "segmentation", "instances", "normals", "flow", "scene_flow", "occlusion"), Image.ros_type
    ),
    "keypoints": StringStamped.ros_type,
}
"""Names and types of truth beside pictures, where a camera publishes it; no real camera does."""
_REAL_MAX_AGE_NS = 100_000_000
"""Age of a stale state of a real arm: ten periods of 10 ms."""


def dvrk_table(params: GatewayParams) -> tuple[Row, ...]:
    """Return every row for the simulated and real arms of `params`.

    Ports are named like their topics, without namespace and leading slash.
    """
    rows: list[Row] = []
    for name, arm in params.arms.driven_arms.items():
        rows += _simulated_arm(name, arm, _reference_frame(name, params))
    for carried in get_args(CartArm):
        rows += _setup_joints(
            carried, _reference_frame(carried, params) if carried in params.arms.present_arms else ""
        )
    for part, topics in PARTS.items():
        if part not in params.listen:
            rows += _events_and_commands(part, topics.events, topics.commands)
    for component in params.teleoperations:
        rows += _events_and_commands(component, TELEOPERATION.events, TELEOPERATION.commands)
    for camera in params.cameras:
        rows += _camera(camera)
    if params.stitching:
        rows += _stitch()
    rows += (
        Row("/tf", TFMessage.ros_type, "publish", periodic=True),
        Row("/joint_states", JointState.ros_type, "publish", periodic=True),
        Row("/robot_description", StringMessage.ros_type, "publish", latched=True),
    )
    prefix = f"/{params.namespace}" if params.namespace else ""
    return (
        *(replace(row, topic=prefix + row.topic) for row in rows),
        DIAGNOSTICS_ROW,
        *(replace(row, is_real=True) for name in params.listen for row in _real_arm(name)),
    )


def _reference_frame(arm: DrivenArm, params: GatewayParams) -> str:
    """Return the `frame_id` of Cartesian states other than `local/`.

    The plan refuses a scenario with another frame in the motion controller.
    """
    return crtk.reference_frame(arm, params.arms.present_arms, params.mounting, params.reference)


def _state(owner: str, name: str, type_: str, **fields: Unpack[SignalFields]) -> Row:
    """Return a row published at the gateway's period."""
    port = signal_in(f"{owner}/{name}", type_, **fields)
    return Row(f"/{owner}/{name}", type_, "publish", port, periodic=True, owner=owner)


def _event(owner: str, name: str, type_: str, *, latched: bool = True) -> Row:
    port = event_in(f"{owner}/{name}", type_)
    return Row(f"/{owner}/{name}", type_, "publish", port, latched=latched, owner=owner)


def _command(owner: str, name: str, type_: str, joints: tuple[str, ...] = ()) -> Row:
    names = joints if type_ == JointState.ros_type else ()
    port = event_out(f"{owner}/{name}", type_, names=names, clock="wall")
    return Row(f"/{owner}/{name}", type_, "subscribe", port, owner=owner)


def _events_and_commands(
    owner: str, events: Mapping[str, str], commands: Mapping[str, str], joints: tuple[str, ...] = ()
) -> Iterator[Row]:
    """Yield a row for each event and command; `joints`: joints of commands with joint positions."""
    yield from (_event(owner, name, type_) for name, type_ in events.items())
    yield from (_command(owner, name, type_, joints) for name, type_ in commands.items())


def _joint_states(owner: str, prefix: str, names: tuple[str, ...]) -> Iterator[Row]:
    for kind in ("measured_js", "setpoint_js"):
        yield _state(owner, prefix + kind, JointState.ros_type, names=names, fields=crtk.MEASURED)


def _simulated_arm(arm: DrivenArm, mounted: AnyArm, reference: str) -> Iterator[Row]:
    names = tuple(joint.name for joint in mounted.chain.joints)
    events, commands = _own_topics(arm)
    yield from _events_and_commands(arm, crtk.EVENTS | events, crtk.COMMANDS | commands, names)
    yield from _joint_states(arm, "", names)
    yield _state(
        arm, "gravity_compensation/setpoint_js", JointState.ros_type, names=names, fields=("effort",)
    )
    for prefix in ("", "local/"):
        for name, type_ in _CARTESIAN_STATES.items():
            frame = crtk.frame_of(arm, prefix + name, reference)
            yield _state(arm, prefix + name, type_, frame=frame)
    for name, type_ in crtk.WRENCH_STATES.items():
        yield _state(arm, name, type_, frame=crtk.frame_of(arm, name, reference))
        jacobian, shape = f"{name.partition('/')[0]}/jacobian", (6, len(names))
        yield _state(arm, jacobian, Float64MultiArray.ros_type, size=6 * len(names), shape=shape)
    for ratio in ("ratio", "ratio_v", "ratio_a"):
        yield _state(arm, f"trajectory_j/{ratio}", Float64Message.ros_type)
    yield from (Row(f"/{arm}/{name}", type_, "serve", owner=arm) for name, type_ in _SERVICES.items())
    if isinstance(mounted, MountedMtm):
        yield _state(
            arm, "gripper/measured_js", JointState.ros_type, names=("gripper",), fields=crtk.MEASURED
        )
        return
    effector = mounted.commanded_end_effector
    if grasping := tuple(joint.name for joint in effector.joints):
        gripper = effector.name
        yield from _joint_states(arm, f"{gripper}/", grasping)
        gripper_commands = {f"{gripper}/{name}": type_ for name, type_ in crtk.GRIPPER_COMMANDS.items()}
        yield from _events_and_commands(arm, {}, gripper_commands, grasping)


def _own_topics(arm: str) -> tuple[dict[str, str], dict[str, str]]:
    """Return events and commands of this kind of arm alone."""
    if arm.startswith("MTM"):
        return crtk.MTM_EVENTS, crtk.MTM_COMMANDS
    if arm.startswith("PSM"):
        return crtk.PSM_EVENTS, crtk.PSM_COMMANDS
    return crtk.ECM_EVENTS, crtk.ECM_COMMANDS


def _setup_joints(arm: CartArm, reference: str) -> Iterator[Row]:
    """Yield the rows of the setup joints under `arm`.

    All four sets have rows, with values or not, because programs connect to all four.
    """
    owner, names = f"SUJ/{arm}", joint_names(arm)
    yield from _events_and_commands(owner, crtk.SETUP_JOINT_EVENTS, crtk.SETUP_JOINT_COMMANDS, names)
    yield _state(owner, "measured_js", JointState.ros_type, names=names)
    yield _state(owner, "measured_cp", PoseStamped.ros_type, frame=reference)
    yield _state(owner, "local/measured_cp", PoseStamped.ros_type, frame=crtk.CART_FRAME)


def _camera(camera: str) -> Iterator[Row]:
    for eye in ("left", "right"):
        yield from (
            _event(camera, f"{eye}/{name}", type_, latched=False)
            for name, type_ in (_PICTURES | _TRUTH).items()
        )
        yield _event(camera, f"{eye}/camera_info", CameraInfo.ros_type, latched=False)
    yield _command(camera, "markers", MarkerArray.ros_type)
    yield _event(camera, "error", StringMessage.ros_type)


def _stitch() -> Iterator[Row]:
    """Yield the rows of a stitch guided by a person: our own topics, of types known to every ROS program."""
    yield _command("stitch", "pick", PointStamped.ros_type)
    yield _command("stitch", "command", StringMessage.ros_type)
    yield _event("stitch", "state", StringMessage.ros_type)
    yield _event("stitch", "status", StringMessage.ros_type)
    yield _event("stitch", "markers", MarkerArray.ros_type, latched=False)


def _real_state(owner: str, name: str, type_: str, **fields: Unpack[SignalFields]) -> Row:
    """Return the row of a periodic state of a real arm."""
    real: SignalFields = {"clock": "wall", "max_age_ns": _REAL_MAX_AGE_NS, **fields}
    port = signal_out(f"{owner}/{name}", type_, **real)
    return Row(f"/{owner}/{name}", type_, "subscribe", port, owner=owner)


def _real_arm(arm: Real) -> Iterator[Row]:
    """Yield the rows of a real arm or of real pedals: states and events are received, commands are sent."""
    if arm == "footpedals":
        yield from _events_and_commands(arm, {}, PEDALS.events)
        return
    names = tuple(joint.name for joint in dvrk.chain(arm).joints)
    is_master, is_psm = arm.startswith("MTM"), arm.startswith("PSM")
    gripper = "gripper" if is_master else "jaw" if is_psm else ""
    for prefix, driven in (("", names), *(((f"{gripper}/", (gripper,)),) if gripper else ())):
        for kind in ("measured_js", "setpoint_js"):
            if (prefix, kind) != ("gripper/", "setpoint_js"):
                yield _real_state(arm, prefix + kind, JointState.ros_type, names=driven, fields=crtk.MEASURED)
    for prefix in ("", "local/"):
        for name, type_ in _CARTESIAN_STATES.items():
            yield _real_state(arm, prefix + name, type_)
    for name, type_ in crtk.WRENCH_STATES.items():
        yield _real_state(arm, name, type_)
    own_events, own_commands = _own_topics(arm)
    for name, type_ in (crtk.EVENTS | own_events).items():
        yield _command(arm, name, type_)
    jaw = {f"jaw/{name}": type_ for name, type_ in crtk.GRIPPER_COMMANDS.items()} if is_psm else {}
    for name, type_ in (crtk.COMMANDS | own_commands | jaw).items():
        # not latched: a late joiner must not move a real arm by an old command
        yield _event(arm, name, type_, latched=False)
