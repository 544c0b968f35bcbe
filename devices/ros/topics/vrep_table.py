"""The table of a gateway with `profile: vrep`: the topics of the authors' simulator, in V-REP.

The source of values is a participant of kind `paper`. Names and types as in the scripts of the authors'
scenes (unina-icaros/dvrk-vrep, 88fe5975, V-REP_scenes), with additional topics of the authors' Python client
(65ef3ccd, dvrk_python/src/dvrk_python/robot.py). Joint states have no names in V-REP. Ours are
`/stereo/markers` and `/stereo/error`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Unpack

from devices.ros.params import GatewayParams
from devices.ros.topics.diagnostics import DIAGNOSTICS_ROW
from devices.ros.topics.row import Row
from hub.participant import SignalFields, event_in, event_out, signal_in
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.setup_joints import CartArm
from schemas.ros import (
    BoolMessage,
    CameraInfo,
    Float64MultiArray,
    Image,
    JointState,
    Pose,
    PoseStamped,
    StringMessage,
)
from schemas.visualization import MarkerArray

__all__ = ["vrep_table"]

_JOINT_STATE, _STRING, _BOOL = JointState.ros_type, StringMessage.ros_type, BoolMessage.ros_type
_DESIRED = ("state_joint_desired", "set_position_joint", "set_position_goal_joint")
_SETUP_JOINTS = 14
"""Right (5), left (5), camera (4)."""
_STITCHES = {
    **dict.fromkeys(
        ("suture_position_dx", "suture_position_sx", "user_position", "user_position_2"), Pose.ros_type
    ),
    "delete_stitches": _BOOL,
    "state_current": _STRING,
}
"""Topics of the authors' suture planner, made into markers by a participant of kind `vrep-sutures`."""
_FILTER = {"kalmanOutput": PoseStamped.ros_type, "Tcn_hat": Float64MultiArray.ros_type}
"""Topics of the authors' filter: here a participant of kind `needle-tracker`."""


def vrep_table(params: GatewayParams) -> tuple[Row, ...]:
    """Return every row for the arms of `params`."""
    return (
        *(row for name, arm in params.arms.present_arms.items() for row in _arm(name, arm)),
        _state("dvrk/setup_joint", "state_joint_current", size=_SETUP_JOINTS),
        _event("dvrk/setup_joint", "robot_state", _STRING),
        *(row for eye in ("left", "right") for row in _camera(eye)),
        _command("stereo", "markers", MarkerArray.ros_type),
        _event("stereo", "error", _STRING, latched=True),
        Row("/release_needle", _BOOL, "subscribe", event_out("release_needle", _BOOL, clock="wall")),
        *(_command("suture_planner", name, type_) for name, type_ in _STITCHES.items()),
        *(Row(f"/{name}", type_, "publish", event_in(name, type_)) for name, type_ in _FILTER.items()),
        DIAGNOSTICS_ROW,
    )


def _arm(arm: CartArm, mounted: MountedPsm | MountedEcm) -> Iterator[Row]:
    owner, joints = f"dvrk/{arm}", len(mounted.chain.joints)
    yield _state(owner, "state_joint_current", size=joints, fields=("position", "velocity"))
    yield from (_command(owner, name, _JOINT_STATE) for name in _DESIRED)
    if isinstance(mounted, MountedPsm):
        yield _event(owner, "current_state" if arm == "PSM1" else "robot_state", _STRING, latched=True)
        yield _command(owner, "set_robot_state", _STRING)
        if mounted.tool.jaw is not None:
            yield _state(owner, "state_jaw_current")
            yield _command(owner, "state_jaw_desired", _JOINT_STATE)


def _camera(eye: str) -> Iterator[Row]:
    for name, type_ in (("image_raw", Image.ros_type), ("camera_info", CameraInfo.ros_type)):
        yield _event("stereo", f"{eye}/{name}", type_)


def _state(owner: str, name: str, **fields: Unpack[SignalFields]) -> Row:
    port = signal_in(f"{owner}/{name}", JointState, **fields)
    return Row(f"/{owner}/{name}", _JOINT_STATE, "publish", port, periodic=True, owner=owner)


def _event(owner: str, name: str, type_: str, *, latched: bool = False) -> Row:
    port = event_in(f"{owner}/{name}", type_)
    return Row(f"/{owner}/{name}", type_, "publish", port, latched=latched, owner=owner)


def _command(owner: str, name: str, type_: str) -> Row:
    port = event_out(f"{owner}/{name}", type_, clock="wall")
    return Row(f"/{owner}/{name}", type_, "subscribe", port, owner=owner)
