"""The message types of CRTK, the Collaborative Robotics Toolkit, field for field as
collaborative-robotics/crtk_msgs (commit 14b04fcf) has them.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from schemas.message import Bool, Float64Array, Message, String
from schemas.ros import BoolMessage, Header, Pose, Quaternion, Twist, Vector3, Wrench

__all__ = [
    "CartesianImpedance",
    "CartesianImpedanceHalfPlaneGains",
    "CartesianState",
    "ForwardKinematicsRequest",
    "ForwardKinematicsResponse",
    "InverseKinematicsRequest",
    "InverseKinematicsResponse",
    "OperatingState",
    "StringStamped",
]


def _empty() -> NDArray[np.float64]:
    return np.zeros(0)


class OperatingState(Message):
    """What a device is doing: `DISABLED`, `ENABLED`, `PAUSED` or `FAULT`, whether it is homed, and whether it
    is busy.
    """

    ros_type: ClassVar[str] = "crtk_msgs/msg/OperatingState"
    header: Header = Header()
    state: String = ""
    is_homed: Bool = False
    is_busy: Bool = False


class StringStamped(Message):
    """A text at a time; as `state_command` one of `enable`, `disable`, `home`, `unhome`, `pause`, `resume`."""

    ros_type: ClassVar[str] = "crtk_msgs/msg/StringStamped"
    header: Header = Header()
    string: String = ""


class CartesianState(Message):
    """Pose, twist and wrench of a tip in one frame, each stated or not."""

    ros_type: ClassVar[str] = "crtk_msgs/msg/CartesianState"
    header: Header = Header()
    pose: Pose = Pose()
    pose_is_valid: BoolMessage = BoolMessage()
    twist: Twist = Twist()
    twist_is_valid: BoolMessage = BoolMessage()
    wrench: Wrench = Wrench()
    wrench_is_valid: BoolMessage = BoolMessage()


class CartesianImpedanceHalfPlaneGains(Message):
    """Gains per axis on one side of a goal: N/m and N s/m of a displacement, N m/rad and N m s/rad of a
    rotation; a spring's are negative.
    """

    ros_type: ClassVar[str] = "crtk_msgs/msg/CartesianImpedanceHalfPlaneGains"
    p: Vector3 = Vector3()
    d: Vector3 = Vector3()
    bias: Vector3 = Vector3()
    """What is added, N or N m."""
    deadband: Vector3 = Vector3()
    """Distance from the goal, m or rad, from which on `p` counts."""


class CartesianImpedance(Message):
    """Springs and dampers between a tip and a goal, along the axes of one orientation for forces and of
    another for torques.
    """

    ros_type: ClassVar[str] = "crtk_msgs/msg/CartesianImpedance"
    header: Header = Header()
    force_orientation: Quaternion = Quaternion()
    force_position: Vector3 = Vector3()
    torque_orientation: Quaternion = Quaternion()
    """The goal of the rotation, too."""
    position_positive: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()
    position_negative: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()
    orientation_positive: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()
    orientation_negative: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()


class ForwardKinematicsRequest(Message):
    """Asks where an arm is at joint positions `jp`; `cp` is not looked at."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryForwardKinematics_Request"
    jp: Float64Array = Field(default_factory=_empty)
    cp: Pose = Pose()


class ForwardKinematicsResponse(Message):
    """Where it is, unless `result` is false: then `message` says why not."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryForwardKinematics_Response"
    cp: Pose = Pose()
    result: Bool = False
    message: String = ""


class InverseKinematicsRequest(Message):
    """Asks for the joint positions, nearest to `jp`, at which an arm is at `cp`."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryInverseKinematics_Request"
    cp: Pose = Pose()
    jp: Float64Array = Field(default_factory=_empty)


class InverseKinematicsResponse(Message):
    """The joint positions, unless `result` is false: then `message` says why there are none."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryInverseKinematics_Response"
    jp: Float64Array = Field(default_factory=_empty)
    result: Bool = False
    message: String = ""
