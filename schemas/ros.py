"""The standard ROS 2 message types that Trocar uses, field for field as ROS 2 Jazzy has them.

`tests/schemas` compares each one with the type store of `rosbags`.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from schemas.message import (
    Bool,
    Byte,
    Bytes,
    Float32Array,
    Float64,
    Float64Array,
    Int32,
    Int32Array,
    Message,
    String,
    StringArray,
    UInt8,
    UInt32,
    fixed_float64,
)

__all__ = [
    "Accel",
    "AccelStamped",
    "BoolMessage",
    "CameraInfo",
    "CompressedImage",
    "DiagnosticArray",
    "DiagnosticStatus",
    "EmptyMessage",
    "Float64Message",
    "Float64MultiArray",
    "Header",
    "Image",
    "JointState",
    "Joy",
    "KeyValue",
    "MultiArrayDimension",
    "MultiArrayLayout",
    "Point",
    "PointStamped",
    "Pose",
    "PoseStamped",
    "PoseWithCovariance",
    "PoseWithCovarianceStamped",
    "Quaternion",
    "QuaternionStamped",
    "RegionOfInterest",
    "StringMessage",
    "TFMessage",
    "Time",
    "Transform",
    "TransformStamped",
    "Twist",
    "TwistStamped",
    "UInt8MultiArray",
    "Vector3",
    "Wrench",
    "WrenchStamped",
]


def _empty_values() -> NDArray[np.float64]:
    return np.zeros(0)


def _no_bytes() -> NDArray[np.uint8]:
    return np.zeros(0, np.uint8)


class Time(Message):
    """Seconds and nanoseconds since the start of the clock that the port declares."""

    ros_type: ClassVar[str] = "builtin_interfaces/msg/Time"
    sec: Int32 = 0
    nanosec: Annotated[UInt32, Field(lt=10**9)] = 0

    @classmethod
    def from_ns(cls, time_ns: int) -> Time:
        """Split integer nanoseconds."""
        return cls(sec=time_ns // 10**9, nanosec=time_ns % 10**9)

    @property
    def ns(self) -> int:
        """The time in integer nanoseconds."""
        return self.sec * 10**9 + self.nanosec


class Header(Message):
    """Stamp and frame of a message."""

    ros_type: ClassVar[str] = "std_msgs/msg/Header"
    stamp: Time = Time()
    frame_id: String = ""


class BoolMessage(Message):
    """A truth value."""

    ros_type: ClassVar[str] = "std_msgs/msg/Bool"
    data: Bool = False


class EmptyMessage(Message):
    """A signal that something shall be done or has happened."""

    ros_type: ClassVar[str] = "std_msgs/msg/Empty"
    structure_needs_at_least_one_member: UInt8 = 0


class Float64Message(Message):
    """A number."""

    ros_type: ClassVar[str] = "std_msgs/msg/Float64"
    data: Float64 = 0.0


class StringMessage(Message):
    """A text."""

    ros_type: ClassVar[str] = "std_msgs/msg/String"
    data: String = ""


class MultiArrayDimension(Message):
    """A dimension of a multi-array."""

    ros_type: ClassVar[str] = "std_msgs/msg/MultiArrayDimension"
    label: String = ""
    size: UInt32 = 0
    stride: UInt32 = 0


class MultiArrayLayout(Message):
    """The dimensions of a multi-array, outermost first."""

    ros_type: ClassVar[str] = "std_msgs/msg/MultiArrayLayout"
    dim: list[MultiArrayDimension] = Field(default_factory=list[MultiArrayDimension])
    data_offset: UInt32 = 0


class Float64MultiArray(Message):
    """Numbers with a layout."""

    ros_type: ClassVar[str] = "std_msgs/msg/Float64MultiArray"
    layout: MultiArrayLayout = MultiArrayLayout()
    data: Float64Array = Field(default_factory=_empty_values)


class UInt8MultiArray(Message):
    """Bytes with a layout."""

    ros_type: ClassVar[str] = "std_msgs/msg/UInt8MultiArray"
    layout: MultiArrayLayout = MultiArrayLayout()
    data: Bytes = Field(default_factory=_no_bytes)


class Vector3(Message):
    """A vector."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Vector3"
    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0


class Point(Message):
    """A position in metres."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Point"
    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0


class PointStamped(Message):
    """A position in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PointStamped"
    header: Header = Header()
    point: Point = Point()


class Quaternion(Message):
    """A unit quaternion (x, y, z, w)."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Quaternion"
    x: Float64 = 0.0
    y: Float64 = 0.0
    z: Float64 = 0.0
    w: Float64 = 1.0


class Pose(Message):
    """Position in metres and orientation."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Pose"
    position: Point = Point()
    orientation: Quaternion = Quaternion()


class PoseStamped(Message):
    """A pose in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PoseStamped"
    header: Header = Header()
    pose: Pose = Pose()


class PoseWithCovariance(Message):
    """A pose and the covariance of x, y, z (m) and of rotations about the frame's x, y, z (rad), 6 x 6."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PoseWithCovariance"
    pose: Pose = Pose()
    covariance: Annotated[NDArray[np.float64], fixed_float64(36)] = Field(
        default_factory=lambda: np.zeros(36)
    )


class PoseWithCovarianceStamped(Message):
    """A pose with its covariance in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PoseWithCovarianceStamped"
    header: Header = Header()
    pose: PoseWithCovariance = PoseWithCovariance()


class QuaternionStamped(Message):
    """An orientation in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/QuaternionStamped"
    header: Header = Header()
    quaternion: Quaternion = Quaternion()


class Transform(Message):
    """Pose of a frame in another one: translation in metres and rotation."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Transform"
    translation: Vector3 = Vector3()
    rotation: Quaternion = Quaternion()


class TransformStamped(Message):
    """Pose of the frame `child_frame_id` in the frame of the header."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/TransformStamped"
    header: Header = Header()
    child_frame_id: String = ""
    transform: Transform = Transform()


class TFMessage(Message):
    """Poses of frames."""

    ros_type: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    transforms: list[TransformStamped] = Field(default_factory=list[TransformStamped])


class Twist(Message):
    """Velocity in m/s and angular velocity in rad/s."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Twist"
    linear: Vector3 = Vector3()
    angular: Vector3 = Vector3()


class TwistStamped(Message):
    """A twist in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/TwistStamped"
    header: Header = Header()
    twist: Twist = Twist()


class Accel(Message):
    """Acceleration in m/s^2 and angular acceleration in rad/s^2."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Accel"
    linear: Vector3 = Vector3()
    angular: Vector3 = Vector3()


class AccelStamped(Message):
    """An acceleration in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/AccelStamped"
    header: Header = Header()
    accel: Accel = Accel()


class Wrench(Message):
    """Force in N and torque in N m."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Wrench"
    force: Vector3 = Vector3()
    torque: Vector3 = Vector3()


class WrenchStamped(Message):
    """A wrench in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/WrenchStamped"
    header: Header = Header()
    wrench: Wrench = Wrench()


class JointState(Message):
    """Joint positions (rad, m), velocities (rad/s, m/s) and efforts (N m, N); an empty array is unknown."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/JointState"
    header: Header = Header()
    name: StringArray = Field(default_factory=list[str])
    position: Float64Array = Field(default_factory=_empty_values)
    velocity: Float64Array = Field(default_factory=_empty_values)
    effort: Float64Array = Field(default_factory=_empty_values)


class Joy(Message):
    """Axes and buttons of a hand-held device."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/Joy"
    header: Header = Header()
    axes: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    buttons: Int32Array = Field(default_factory=lambda: np.zeros(0, np.int32))


class Image(Message):
    """An uncompressed image, row after row from the top.

    The stamp is when it was taken, the frame the camera's optical frame.
    """

    ros_type: ClassVar[str] = "sensor_msgs/msg/Image"
    header: Header = Header()
    height: UInt32 = 0
    width: UInt32 = 0
    encoding: String = ""
    is_bigendian: UInt8 = 0
    step: UInt32 = 0
    data: Bytes = Field(default_factory=_no_bytes)


class CompressedImage(Message):
    """An image as a file of the named format: `jpeg` or `png`."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/CompressedImage"
    header: Header = Header()
    format: String = ""
    data: Bytes = Field(default_factory=_no_bytes)


class RegionOfInterest(Message):
    """The part of the full image taken; all zeros for the whole."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/RegionOfInterest"
    x_offset: UInt32 = 0
    y_offset: UInt32 = 0
    height: UInt32 = 0
    width: UInt32 = 0
    do_rectify: Bool = False


class CameraInfo(Message):
    """A camera's calibration: distortion d, intrinsics k, rectification r and projection p.

    k and r are 3 x 3, p is 3 x 4, row after row.
    """

    ros_type: ClassVar[str] = "sensor_msgs/msg/CameraInfo"
    header: Header = Header()
    height: UInt32 = 0
    width: UInt32 = 0
    distortion_model: String = ""
    d: Float64Array = Field(default_factory=_empty_values)
    k: Annotated[NDArray[np.float64], fixed_float64(9)] = Field(default_factory=lambda: np.zeros(9))
    r: Annotated[NDArray[np.float64], fixed_float64(9)] = Field(default_factory=lambda: np.zeros(9))
    p: Annotated[NDArray[np.float64], fixed_float64(12)] = Field(default_factory=lambda: np.zeros(12))
    binning_x: UInt32 = 0
    binning_y: UInt32 = 0
    roi: RegionOfInterest = RegionOfInterest()


class KeyValue(Message):
    """A reading of a diagnosis."""

    ros_type: ClassVar[str] = "diagnostic_msgs/msg/KeyValue"
    key: String
    value: String


class DiagnosticStatus(Message):
    """The condition of a piece of hardware."""

    ros_type: ClassVar[str] = "diagnostic_msgs/msg/DiagnosticStatus"
    level: Byte = 0
    """0 ok, 1 warning, 2 error, 3 stale."""
    name: String
    message: String
    hardware_id: String = ""
    values: list[KeyValue] = Field(default_factory=list[KeyValue])


class DiagnosticArray(Message):
    """The conditions of several pieces of hardware or software."""

    ros_type: ClassVar[str] = "diagnostic_msgs/msg/DiagnosticArray"
    header: Header = Header()
    status: list[DiagnosticStatus] = Field(default_factory=list[DiagnosticStatus])
