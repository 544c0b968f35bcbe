"""The message types of CRTK, the Collaborative Robotics Toolkit.

Field for field as in collaborative-robotics/crtk_msgs (commit 14b04fcf).
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


def _empty_values() -> NDArray[np.float64]:
    return np.zeros(0)


class OperatingState(Message):
    """State of a device: `DISABLED`, `ENABLED`, `PAUSED` or `FAULT`; homed or not, busy or not."""

    ros_type: ClassVar[str] = "crtk_msgs/msg/OperatingState"
    header: Header = Header()
    state: String = ""
    is_homed: Bool = False
    is_busy: Bool = False


class StringStamped(Message):
    """A text at a time.

    Texts of `state_command`: `enable`, `disable`, `home`, `unhome`, `pause`, `resume`.
    """

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
    """Gains per axis on one side of a goal.

    N/m and N s/m of a displacement, N m/rad and N m s/rad of a rotation; gains of a spring are negative.
    """

    ros_type: ClassVar[str] = "crtk_msgs/msg/CartesianImpedanceHalfPlaneGains"
    p: Vector3 = Vector3()
    d: Vector3 = Vector3()
    bias: Vector3 = Vector3()
    """Added force or torque, N or N m."""
    deadband: Vector3 = Vector3()
    """Distance from the goal, m or rad, beyond which `p` acts."""


class CartesianImpedance(Message):
    """Springs and dampers between a tip and a goal.

    Those of forces act along the axes of one orientation, those of torques along the axes of another.
    """

    ros_type: ClassVar[str] = "crtk_msgs/msg/CartesianImpedance"
    header: Header = Header()
    force_orientation: Quaternion = Quaternion()
    force_position: Vector3 = Vector3()
    torque_orientation: Quaternion = Quaternion()
    """Also the goal of the rotation."""
    position_positive: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()
    position_negative: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()
    orientation_positive: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()
    orientation_negative: CartesianImpedanceHalfPlaneGains = CartesianImpedanceHalfPlaneGains()


class ForwardKinematicsRequest(Message):
    """Asks for the pose of an arm's tip at joint positions `jp`; `cp` is ignored."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryForwardKinematics_Request"
    jp: Float64Array = Field(default_factory=_empty_values)
    cp: Pose = Pose()


class ForwardKinematicsResponse(Message):
    """The pose, unless `result` is false: then `message` has the reason."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryForwardKinematics_Response"
    cp: Pose = Pose()
    result: Bool = False
    message: String = ""


class InverseKinematicsRequest(Message):
    """Asks for the joint positions nearest to `jp` at which the tip of an arm is at `cp`."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryInverseKinematics_Request"
    cp: Pose = Pose()
    jp: Float64Array = Field(default_factory=_empty_values)


class InverseKinematicsResponse(Message):
    """The joint positions, unless `result` is false: then `message` has the reason."""

    ros_type: ClassVar[str] = "crtk_msgs/srv/QueryInverseKinematics_Response"
    jp: Float64Array = Field(default_factory=_empty_values)
    result: Bool = False
    message: String = ""
