"""Samples of devices from plain numbers: what every stylus and every headset gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from devices.vendor_axes import Quaternion, Vector3
from hub.participant import Sample
from schemas.ports import Port
from schemas.ros import Header, Joy, Point, Pose, PoseStamped, Time, Twist, TwistStamped
from schemas.ros import Quaternion as QuaternionMessage
from schemas.ros import Vector3 as Vector3Message

__all__ = ["button_sample", "pose_sample", "twist_sample"]


def pose_sample(port: Port, time_ns: int, position: Vector3, orientation: Quaternion) -> Sample:
    """Return a pose, m and quaternion (x, y, z, w), in the port's frame at `time_ns` of the port's clock."""
    (x, y, z), (qx, qy, qz, qw) = position, orientation
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=QuaternionMessage(x=qx, y=qy, z=qz, w=qw))
    return Sample(port.name, PoseStamped(header=_header(port, time_ns), pose=pose))


def twist_sample(port: Port, time_ns: int, linear: Vector3, angular: Vector3) -> Sample:
    """Return the velocity (m/s) of a frame's origin and its angular velocity (rad/s), both along the axes of
    the port's frame.
    """
    (vx, vy, vz), (wx, wy, wz) = linear, angular
    twist = Twist(linear=Vector3Message(x=vx, y=vy, z=vz), angular=Vector3Message(x=wx, y=wy, z=wz))
    return Sample(port.name, TwistStamped(header=_header(port, time_ns), twist=twist))


def button_sample(port: Port, time_ns: int, pressed: Sequence[bool]) -> Sample:
    """Return the buttons of a hand-held device."""
    return Sample(port.name, Joy(header=_header(port, time_ns), buttons=np.array(pressed, np.int32)))


def _header(port: Port, time_ns: int) -> Header:
    return Header(stamp=Time.from_ns(time_ns), frame_id=port.frame)
