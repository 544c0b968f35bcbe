"""CRTK as the arms of a dVRK have it: commands and events, their ROS 2 types, and the frames of states.

Names of commands and events are those after the arm's: `PSM1/servo_jp` is `servo_jp`. All that command an
arm or show one (the motion controller, the dVRK's console, the ROS gateways) take them from here.

Sources: names, types and directions from jhu-cisst/cisst-ros (commit 73aca61c,
mts_ros_crtk_bridge_provided.cpp) and jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68,
ros/dvrk_robot/src/system_ROS.cpp and core/components/code/mtsIntuitiveResearchKit{Arm,PSM,ECM,MTM,SUJ}.cpp);
what clients in Python need beside from jhu-dvrk/dvrk_python (a1b337b3) and crtk_python_client (33b4c387).
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

from robots.dvrk.mtm import DISPLAY_FRAME
from schemas.crtk import CartesianImpedance, CartesianState, OperatingState, StringStamped
from schemas.ros import (
    BoolMessage,
    EmptyMessage,
    Float64Message,
    JointState,
    Joy,
    PoseStamped,
    Quaternion,
    StringMessage,
    TwistStamped,
    WrenchStamped,
)

__all__ = [
    "CAMERA_FRAME",
    "CARTESIAN_COMMANDS",
    "CARTESIAN_STATES",
    "CART_FRAME",
    "COMMANDS",
    "ECM_COMMANDS",
    "ECM_EVENTS",
    "EVENTS",
    "GRIPPER_COMMANDS",
    "MEASURED",
    "MTM_COMMANDS",
    "MTM_EVENTS",
    "PSM_COMMANDS",
    "PSM_EVENTS",
    "SETTINGS",
    "SETUP_JOINT_COMMANDS",
    "SETUP_JOINT_EVENTS",
    "WORLD_FRAME",
    "WRENCH_STATES",
    "Mounting",
    "Reference",
    "base_frame",
    "frame_of",
    "is_move",
    "is_ready",
    "is_stream",
    "reference_frame",
    "tip_frame",
]

COMMANDS = {
    "state_command": StringStamped.ros_type,
    "use_gravity_compensation": BoolMessage.ros_type,
    "trajectory_j/set_ratio": Float64Message.ros_type,
    "trajectory_j/set_ratio_v": Float64Message.ros_type,
    "trajectory_j/set_ratio_a": Float64Message.ros_type,
    "body/set_cf_orientation_absolute": BoolMessage.ros_type,
    "set_base_frame": PoseStamped.ros_type,
    "hold": EmptyMessage.ros_type,
    "free": EmptyMessage.ros_type,
    "servo_jp": JointState.ros_type,
    "servo_jr": JointState.ros_type,
    "servo_cp": PoseStamped.ros_type,
    "servo_cr": PoseStamped.ros_type,
    "servo_cs": CartesianState.ros_type,
    "servo_ci": CartesianImpedance.ros_type,
    "servo_jf": JointState.ros_type,
    "body/servo_cf": WrenchStamped.ros_type,
    "spatial/servo_cf": WrenchStamped.ros_type,
    "move_jp": JointState.ros_type,
    "move_jr": JointState.ros_type,
    "move_cp": PoseStamped.ros_type,
}
"""To every arm. A controller executes commands that arrive in the same step in this order."""

CARTESIAN_COMMANDS = frozenset(
    {"servo_cp", "servo_cr", "servo_cs", "servo_ci", "body/servo_cf", "spatial/servo_cf", "move_cp"}
)
"""Commands to the tip: a PSM executes them only past the cannula."""

SETTINGS = frozenset(
    {
        "use_gravity_compensation",
        "trajectory_j/set_ratio",
        "trajectory_j/set_ratio_v",
        "trajectory_j/set_ratio_a",
        "body/set_cf_orientation_absolute",
        "set_base_frame",
    }
)
"""Commands that move nothing: an arm executes them in every operating state."""

GRIPPER_COMMANDS = {
    "servo_jp": JointState.ros_type,
    "servo_jf": JointState.ros_type,
    "move_jp": JointState.ros_type,
}
"""Under `jaw/` (or `hand/`, which is ours) of an arm whose instrument grasps."""

EVENTS = {
    "operating_state": OperatingState.ros_type,
    "desired_state": StringMessage.ros_type,
    "goal_reached": BoolMessage.ros_type,
    "error": StringMessage.ros_type,
    "warning": StringMessage.ros_type,
    "status": StringMessage.ros_type,
}
"""Events of every arm."""

PSM_COMMANDS = {
    "set_tool_type": StringMessage.ros_type,
    "emulate_adapter_present": BoolMessage.ros_type,
    "emulate_tool_present": BoolMessage.ros_type,
}
PSM_EVENTS = {
    "tool_type": StringMessage.ros_type,
    "tool_type_request": EmptyMessage.ros_type,
    "arm_clutch": Joy.ros_type,
    "IO/arm_clutch": Joy.ros_type,
    "IO/SUJ_clutch": Joy.ros_type,
    "IO/adapter": Joy.ros_type,
    "IO/tool": Joy.ros_type,
}
ECM_COMMANDS = {"set_endoscope_type": StringMessage.ros_type}
ECM_EVENTS = {
    "endoscope_type": StringMessage.ros_type,
    "arm_clutch": Joy.ros_type,
    "IO/arm_clutch": Joy.ros_type,
    "IO/SUJ_clutch": Joy.ros_type,
}
MTM_COMMANDS = {"lock_orientation": Quaternion.ros_type, "unlock_orientation": EmptyMessage.ros_type}
MTM_EVENTS = {
    "gripper/pinch": EmptyMessage.ros_type,
    "gripper/closed": BoolMessage.ros_type,
    "orientation_locked": BoolMessage.ros_type,
}
"""Topics of a kind of arm alone, beside `COMMANDS` and `EVENTS`."""

SETUP_JOINT_COMMANDS = {
    "state_command": StringStamped.ros_type,
    "servo_jp": JointState.ros_type,
    "move_jp": JointState.ros_type,
}
SETUP_JOINT_EVENTS = {
    "operating_state": OperatingState.ros_type,
    "error": StringMessage.ros_type,
    "warning": StringMessage.ros_type,
    "status": StringMessage.ros_type,
}
"""Topics of the setup joints under an arm, under `SUJ/<arm>/`."""

MEASURED: tuple[Literal["position", "velocity", "effort"], ...] = ("position", "velocity", "effort")
"""What `measured_js` and `setpoint_js` state of every joint."""

CARTESIAN_STATES = {
    "measured_cp": PoseStamped.ros_type,
    "measured_cv": TwistStamped.ros_type,
    "setpoint_cp": PoseStamped.ros_type,
    "setpoint_cv": TwistStamped.ros_type,
}
"""Pose and twist of the tip, also under `local/`. The real bridge does not publish `setpoint_cv`."""

WRENCH_STATES = {
    "body/measured_cf": WrenchStamped.ros_type,
    "spatial/measured_cf": WrenchStamped.ros_type,
}

CAMERA_FRAME, CART_FRAME, WORLD_FRAME = "ECM", "Cart", "world"
"""`frame_id` of the ECM's tip, of the patient cart and of the world.

The first two are the names of the da Vinci's own interface and the dVRK; the world is ours.
"""
Mounting = Literal["free", "cart"]
"""How arms stand: each by itself, or on the setup joints of the cart, whose frame is then the world."""
Reference = Literal["camera", "base", "world"]
"""What the Cartesian states and commands of an arm refer to."""


def base_frame(arm: str) -> str:
    """Return the `frame_id` of the arm's base."""
    return f"{arm}_base"


def tip_frame(arm: str) -> str:
    """Return the `frame_id` of the arm's tip."""
    return f"{arm}_tip"


def reference_frame(arm: str, arms: Collection[str], mounting: Mounting, reference: Reference) -> str:
    """Return the `frame_id` of the arm's Cartesian states and commands that are not `local/`.

    On the real system (jhu-dvrk/sawIntuitiveResearchKit) a PSM is seen from the camera, the ECM from the
    cart, a master from the stereo viewer.

    Args:
        arm: name, such as `PSM1`.
        arms: the names of all arms that are there; without an ECM there is no camera to refer to.
        mounting: how the arms stand.
        reference: what the scenario refers to.
    """
    world = CART_FRAME if mounting == "cart" else WORLD_FRAME
    if reference == "world":
        return world
    if reference == "camera" and arm.startswith("MTM"):
        return DISPLAY_FRAME
    if reference == "base" or "ECM" not in arms:
        return base_frame(arm)
    return CART_FRAME if arm == "ECM" else CAMERA_FRAME


def frame_of(arm: str, state: str, reference: str) -> str:
    """Return the `frame_id` of a Cartesian state, such as `local/measured_cp`.

    A body wrench has none: it is along the axes of the tip or, after `body/set_cf_orientation_absolute`, of
    the reference.

    Args:
        arm: name, such as `PSM1`.
        state: name of the state.
        reference: `frame_id` of states that are not `local/` (`reference_frame`).
    """
    first = state.partition("/")[0]
    return "" if first == "body" else base_frame(arm) if first in ("local", "spatial") else reference


def is_ready(message: OperatingState) -> bool:
    """Return whether an arm in this operating state executes motion commands."""
    return message.state == "ENABLED" and message.is_homed


def is_stream(command: str) -> bool:
    """Return whether a command is one of a stream: `servo_jp`, `body/servo_cf`, `jaw/servo_jp`."""
    return command.rpartition("/")[2].startswith("servo_")


def is_move(command: str) -> bool:
    """Return whether a command starts a trajectory to a goal: `move_jp`, `jaw/move_jp`."""
    return command.rpartition("/")[2].startswith("move_")
