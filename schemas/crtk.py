"""The message types of CRTK, the Collaborative Robotics Toolkit, field for field as collaborative-robotics/crtk_msgs (commit 14b04fcf) has them."""

from __future__ import annotations

from typing import ClassVar

from schemas.message import Bool, Message, String
from schemas.ros import BoolMessage, Header, Pose, Twist, Wrench

__all__ = ["CartesianState", "OperatingState", "StringStamped"]


class OperatingState(Message):
    """What a device is doing: `DISABLED`, `ENABLED`, `PAUSED` or `FAULT`, whether it is homed, and whether it is busy."""

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
