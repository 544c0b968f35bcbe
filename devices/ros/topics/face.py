"""The dVRK as ROS programs see it: every topic and service of the simulated arms, the console, the pedals and
the cameras, in one table.

Sources: what is published and subscribed to, and its types, from jhu-cisst/cisst-ros (commit 73aca61c,
mts_ros_crtk_bridge_provided.cpp) and jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68,
ros/dvrk_robot/src/system_ROS.cpp and core/components/code/mtsIntuitiveResearchKit{Arm,PSM,ECM,MTM,SUJ}.cpp);
what programs in Python cannot do without from jhu-dvrk/dvrk_python (a1b337b3) and crtk_python_client
(33b4c387); cameras from jhu-dvrk/dvrk-readthedocs (53699e4d, docs/pages/video/software/ros.rst). All events
are latched, as there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import get_args

from devices.ros.params import GatewayParams, Real
from devices.ros.topics.row import Row
from robots.dvrk import arms as dvrk
from robots.dvrk.console_topics import BUTTON, CONSOLE, PEDALS, SYSTEM, TELEOPERATION, Topics
from robots.dvrk.mounted import MountedEcm, MountedPsm
from robots.dvrk.setup_joints import JOINT_NAMES, CartArm
from schemas.ports import Port

__all__ = ["NOT_SERVED", "face"]

_JOINT_STATE, _POSE, _TWIST, _WRENCH = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/WrenchStamped",
)
_EMPTY, _STRING, _BOOL, _FLOAT, _ARRAY = (
    f"std_msgs/msg/{name}" for name in ("Empty", "String", "Bool", "Float64", "Float64MultiArray")
)
_STATE_COMMAND, _OPERATING_STATE = "crtk_msgs/msg/StringStamped", "crtk_msgs/msg/OperatingState"
_FORWARD, _INVERSE = "crtk_msgs/srv/QueryForwardKinematics", "crtk_msgs/srv/QueryInverseKinematics"

NOT_SERVED = {
    "actuator_to_joint_position": "a simulated arm has no actuators whose encoders a program could read",
    "setpoint_cv": "the real bridge does not publish it either",
}
"""Names of the real system that are left out, and why."""

_MEASURED = ("position", "velocity", "effort")

_EVENTS = {
    "operating_state": _OPERATING_STATE,
    "desired_state": _STRING,
    "goal_reached": _BOOL,
    "error": _STRING,
    "warning": _STRING,
    "status": _STRING,
}
_COMMANDS = {
    "state_command": _STATE_COMMAND,
    "hold": _EMPTY,
    "free": _EMPTY,
    "servo_jp": _JOINT_STATE,
    "servo_jr": _JOINT_STATE,
    "servo_jf": _JOINT_STATE,
    "move_jp": _JOINT_STATE,
    "move_jr": _JOINT_STATE,
    "servo_cp": _POSE,
    "servo_cr": _POSE,
    "move_cp": _POSE,
    "servo_cs": "crtk_msgs/msg/CartesianState",
    "servo_ci": "crtk_msgs/msg/CartesianImpedance",
    "body/servo_cf": _WRENCH,
    "spatial/servo_cf": _WRENCH,
    "use_gravity_compensation": _BOOL,
    "body/set_cf_orientation_absolute": _BOOL,
    "set_base_frame": _POSE,
    "trajectory_j/set_ratio": _FLOAT,
    "trajectory_j/set_ratio_v": _FLOAT,
    "trajectory_j/set_ratio_a": _FLOAT,
}
_GRIPPER_COMMANDS = {"servo_jp": _JOINT_STATE, "servo_jf": _JOINT_STATE, "move_jp": _JOINT_STATE}

_PSM_EVENTS = {
    "tool_type": _STRING,
    "tool_type_request": _EMPTY,
    "arm_clutch": BUTTON,
    "IO/arm_clutch": BUTTON,
    "IO/SUJ_clutch": BUTTON,
    "IO/adapter": BUTTON,
    "IO/tool": BUTTON,
}
_PSM_COMMANDS = {"set_tool_type": _STRING, "emulate_adapter_present": _BOOL, "emulate_tool_present": _BOOL}
_ECM_EVENTS = {
    "endoscope_type": _STRING,
    "arm_clutch": BUTTON,
    "IO/arm_clutch": BUTTON,
    "IO/SUJ_clutch": BUTTON,
}
_ECM_COMMANDS = {"set_endoscope_type": _STRING}
_MTM_EVENTS = {"gripper/pinch": _EMPTY, "gripper/closed": _BOOL, "orientation_locked": _BOOL}
_MTM_COMMANDS = {"lock_orientation": "geometry_msgs/msg/Quaternion", "unlock_orientation": _EMPTY}

_SUJ_EVENTS = {"operating_state": _OPERATING_STATE, "error": _STRING, "warning": _STRING, "status": _STRING}
_SUJ_COMMANDS = {"state_command": _STATE_COMMAND, "servo_jp": _JOINT_STATE, "move_jp": _JOINT_STATE}

_PARTS = {
    "system": SYSTEM,
    "console": CONSOLE,
    "footpedals": PEDALS,
    "SUJ": Topics({}, {"set_reference_arm": _STRING}),
}
"""What there is once."""

_PICTURES = {"image_raw": "sensor_msgs/msg/Image", "image_raw/compressed": "sensor_msgs/msg/CompressedImage"}


def face(params: GatewayParams) -> tuple[Row, ...]:
    """Return every row of what `params` show and listen to; port names are topic names without namespace and
    leading slash.
    """
    rows: list[Row] = []
    for name, arm in params.arms.shown.items():
        rows += _shown(name, arm, _reference(name, params))
    for carried in get_args(CartArm):
        rows += _setup_joints(carried, _reference(carried, params) if carried in params.arms.shown else "")
    for part, topics in _PARTS.items():
        if part not in params.listen:
            rows += _talk(part, topics.events, topics.commands)
    for component in params.teleoperations:
        rows += _talk(component, TELEOPERATION.events, TELEOPERATION.commands)
    for camera in params.cameras:
        rows += _camera(camera)
    rows += (
        Row("/tf", "tf2_msgs/msg/TFMessage", "publish", periodic=True),
        Row("/joint_states", _JOINT_STATE, "publish", periodic=True),
        Row("/robot_description", _STRING, "publish", latched=True),
    )
    return tuple(_named(row, params.namespace) for row in rows) + tuple(
        replace(row, is_real=True) for name in params.listen for row in _listened(name)
    )


def _reference(arm: CartArm, params: GatewayParams) -> str:
    """Return the `frame_id` of Cartesian states that are not `local/`, by the motion controller's rule; the
    plan refuses a scenario where the two differ.
    """
    world = "Cart" if params.mounting == "cart" else "world"
    if params.reference == "world":
        return world
    if params.reference == "base" or "ECM" not in params.arms.shown:
        return f"{arm}_base"
    return "Cart" if arm == "ECM" else "ECM"


def _named(row: Row, namespace: str) -> Row:
    return (
        Row(f"/{namespace}{row.topic}", row.type, row.way, row.port, row.latched, row.periodic, row.owner)
        if namespace
        else row
    )


def _state(owner: str, name: str, type_: str, **more: object) -> Row:
    """Return a row of what is published all the time."""
    port = Port.model_validate({"name": f"{owner}/{name}", "causality": "input", "type": type_} | more)
    return Row(f"/{owner}/{name}", type_, "publish", port, periodic=True, owner=owner)


def _event(owner: str, name: str, type_: str, *, latched: bool = True) -> Row:
    port = Port(name=f"{owner}/{name}", causality="input", type=type_, variability="event")
    return Row(f"/{owner}/{name}", type_, "publish", port, latched=latched, owner=owner)


def _command(owner: str, name: str, type_: str, joints: tuple[str, ...] = ()) -> Row:
    names = joints if type_ == _JOINT_STATE else ()
    port = Port(
        name=f"{owner}/{name}", causality="output", type=type_, variability="event", names=names, clock="wall"
    )
    return Row(f"/{owner}/{name}", type_, "subscribe", port, owner=owner)


def _service(owner: str, name: str, type_: str) -> Row:
    return Row(f"/{owner}/{name}", type_, "serve", owner=owner)


def _talk(
    owner: str, events: Mapping[str, str], commands: Mapping[str, str], joints: tuple[str, ...] = ()
) -> Iterator[Row]:
    """Yield rows of events and of commands, those with joint positions to `joints`."""
    yield from (_event(owner, name, type_) for name, type_ in events.items())
    yield from (_command(owner, name, type_, joints) for name, type_ in commands.items())


def _joint_states(owner: str, prefix: str, names: tuple[str, ...]) -> Iterator[Row]:
    for kind in ("measured_js", "setpoint_js"):
        yield _state(owner, prefix + kind, _JOINT_STATE, names=names, fields=_MEASURED)


def _shown(arm: CartArm, mounted: MountedPsm | MountedEcm, reference: str) -> Iterator[Row]:
    """Yield the rows of a simulated arm."""
    names, base = tuple(joint.name for joint in mounted.chain.joints), f"{arm}_base"
    is_psm = isinstance(mounted, MountedPsm)
    events, commands = (_PSM_EVENTS, _PSM_COMMANDS) if is_psm else (_ECM_EVENTS, _ECM_COMMANDS)
    yield from _talk(arm, _EVENTS | events, _COMMANDS | commands, names)
    yield from _joint_states(arm, "", names)
    yield _state(arm, "gravity_compensation/setpoint_js", _JOINT_STATE, names=names, fields=("effort",))
    for prefix, frame in (("", reference), ("local/", base)):
        yield _state(arm, f"{prefix}measured_cp", _POSE, frame=frame)
        yield _state(arm, f"{prefix}setpoint_cp", _POSE, frame=frame)
        yield _state(arm, f"{prefix}measured_cv", _TWIST, frame=frame)
    for kind, frame in (("body", ""), ("spatial", base)):
        yield _state(arm, f"{kind}/measured_cf", _WRENCH, frame=frame)
        yield _state(arm, f"{kind}/jacobian", _ARRAY, size=6 * len(names), shape=(6, len(names)))
    for ratio in ("ratio", "ratio_v", "ratio_a"):
        yield _state(arm, f"trajectory_j/{ratio}", _FLOAT)
    yield from (_service(arm, name, type_) for name, type_ in _SERVICES.items())
    if isinstance(mounted, MountedPsm) and (mounted.tool.jaw is not None or mounted.tool.hand is not None):
        gripper, driven = (
            ("jaw", mounted.tool.jaw_joints)
            if mounted.tool.hand is None
            else ("hand", mounted.tool.hand.joints)
        )
        grasping = tuple(joint.name for joint in driven)
        yield from _joint_states(arm, f"{gripper}/", grasping)
        yield from _talk(
            arm, {}, {f"{gripper}/{name}": type_ for name, type_ in _GRIPPER_COMMANDS.items()}, grasping
        )


_SERVICES = {
    "forward_kinematics": _FORWARD,
    "local/forward_kinematics": _FORWARD,
    "inverse_kinematics": _INVERSE,
}


def _setup_joints(arm: CartArm, reference: str) -> Iterator[Row]:
    """Yield the rows of the setup joints that carry `arm`: all four sets are there, as programs ask for all
    of them, fed or not.
    """
    owner, names = f"SUJ/{arm}", tuple(f"SUJ_{arm}_J{index}" for index in range(len(JOINT_NAMES)))
    yield from _talk(owner, _SUJ_EVENTS, _SUJ_COMMANDS, names)
    yield _state(owner, "measured_js", _JOINT_STATE, names=names)
    yield _state(owner, "measured_cp", _POSE, frame=reference)
    yield _state(owner, "local/measured_cp", _POSE, frame="Cart")


def _camera(camera: str) -> Iterator[Row]:
    for eye in ("left", "right"):
        yield from (
            _event(camera, f"{eye}/{name}", type_, latched=False) for name, type_ in _PICTURES.items()
        )
        yield _event(camera, f"{eye}/camera_info", "sensor_msgs/msg/CameraInfo", latched=False)


def _heard(owner: str, name: str, type_: str, **more: object) -> Row:
    """Return a row of what a real arm publishes all the time."""
    port = Port.model_validate(
        {
            "name": f"{owner}/{name}",
            "causality": "output",
            "type": type_,
            "clock": "wall",
            "max_age_ns": _REAL_MAX_AGE_NS,
        }
        | more
    )
    return Row(f"/{owner}/{name}", type_, "subscribe", port, owner=owner)


_REAL_MAX_AGE_NS = 100_000_000
"""A state of a real arm that is older is marked stale: ten periods of 10 ms."""


def _listened(arm: Real) -> Iterator[Row]:
    """Yield the rows of a real arm: its states and events come in, commands to it go out; or those of real
    pedals.
    """
    if arm == "footpedals":
        yield from _talk(arm, {}, PEDALS.events)
        return
    names = tuple(joint.name for joint in dvrk.chain(arm).joints)
    is_master, is_psm = arm.startswith("MTM"), arm.startswith("PSM")
    gripper = "gripper" if is_master else "jaw" if is_psm else ""
    for prefix, driven in (("", names), *(((f"{gripper}/", (gripper,)),) if gripper else ())):
        yield _heard(arm, f"{prefix}measured_js", _JOINT_STATE, names=driven, fields=_MEASURED)
        if prefix != "gripper/":
            yield _heard(arm, f"{prefix}setpoint_js", _JOINT_STATE, names=driven, fields=_MEASURED)
    for prefix in ("", "local/"):
        yield _heard(arm, f"{prefix}measured_cp", _POSE)
        yield _heard(arm, f"{prefix}setpoint_cp", _POSE)
        yield _heard(arm, f"{prefix}measured_cv", _TWIST)
    for kind in ("body", "spatial"):
        yield _heard(arm, f"{kind}/measured_cf", _WRENCH)
    own_events, own_commands = (
        (_MTM_EVENTS, _MTM_COMMANDS)
        if is_master
        else (_PSM_EVENTS, _PSM_COMMANDS)
        if is_psm
        else (_ECM_EVENTS, _ECM_COMMANDS)
    )
    for name, type_ in (_EVENTS | own_events).items():
        yield _command(arm, name, type_)
    jaw = {f"jaw/{name}": type_ for name, type_ in _GRIPPER_COMMANDS.items()} if is_psm else {}
    for name, type_ in (_COMMANDS | own_commands | jaw).items():
        # a real arm is told once: who comes late must not be moved by it
        yield _event(arm, name, type_, latched=False)
