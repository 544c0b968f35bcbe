"""The messages of `visualization_msgs`, field for field as ROS 2 Jazzy has them: markers in a scene.

`tests/schemas` compares each message with the type store of `rosbags`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from schemas.message import Bool, Bytes, Float32, Int32, Message, String, UInt32
from schemas.ros import CompressedImage, Header, Point, Pose, Vector3

__all__ = [
    "MOST_MARKERS",
    "ColorRGBA",
    "DurationMessage",
    "Marker",
    "MarkerAction",
    "MarkerArray",
    "MarkerType",
    "MeshFile",
    "UVCoordinate",
]

MOST_MARKERS = 4000
"""Most markers in a message, and on show at a time: twice the number of the V-REP scenes (1000 points of each
colour).
"""


class MarkerType(IntEnum):
    """Shape of a marker (visualization_msgs/Marker.msg)."""

    ARROW = 0
    CUBE = 1
    SPHERE = 2
    CYLINDER = 3
    LINE_STRIP = 4
    LINE_LIST = 5
    CUBE_LIST = 6
    SPHERE_LIST = 7
    POINTS = 8
    TEXT_VIEW_FACING = 9
    MESH_RESOURCE = 10
    TRIANGLE_LIST = 11
    ARROW_STRIP = 12


class MarkerAction(IntEnum):
    """Change of a marker (visualization_msgs/Marker.msg); MODIFY is ADD."""

    ADD = 0
    DELETE = 2
    DELETEALL = 3


class DurationMessage(Message):
    """A time span; negative ones count back from whole seconds."""

    ros_type: ClassVar[str] = "builtin_interfaces/msg/Duration"
    sec: Int32 = 0
    nanosec: Annotated[UInt32, Field(lt=10**9)] = 0

    @classmethod
    def from_ns(cls, span_ns: int) -> DurationMessage:
        """Split integer nanoseconds."""
        return cls(sec=span_ns // 10**9, nanosec=span_ns % 10**9)

    @property
    def ns(self) -> int:
        """The time span in integer nanoseconds."""
        return self.sec * 10**9 + self.nanosec


class ColorRGBA(Message):
    """A colour, each part from 0 to 1; `a` 0 is invisible."""

    ros_type: ClassVar[str] = "std_msgs/msg/ColorRGBA"
    r: Float32 = 0.0
    g: Float32 = 0.0
    b: Float32 = 0.0
    a: Float32 = 0.0


class UVCoordinate(Message):
    """Place of a vertex in a texture."""

    ros_type: ClassVar[str] = "visualization_msgs/msg/UVCoordinate"
    u: Float32 = 0.0
    v: Float32 = 0.0


class MeshFile(Message):
    """A mesh as the bytes of a file."""

    ros_type: ClassVar[str] = "visualization_msgs/msg/MeshFile"
    filename: String = ""
    data: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))


class Marker(Message):
    """A shape or text to show, named by `ns` and `id`; metres, in the frame of the header."""

    ros_type: ClassVar[str] = "visualization_msgs/msg/Marker"
    header: Header = Header()
    ns: String = ""
    id: Int32 = 0
    type: Int32 = 0
    """A `MarkerType`."""
    action: Int32 = 0
    """A `MarkerAction`."""
    pose: Pose = Pose()
    scale: Vector3 = Vector3()
    color: ColorRGBA = ColorRGBA()
    lifetime: DurationMessage = DurationMessage()
    """Time until the marker vanishes; 0: never."""
    frame_locked: Bool = False
    """True: the marker moves with its frame. False: the marker stays at its first place in the world."""
    points: list[Point] = Field(default_factory=list[Point])
    colors: list[ColorRGBA] = Field(default_factory=list[ColorRGBA])
    """Colour of each point; empty: all points have `color`."""
    texture_resource: String = ""
    texture: CompressedImage = CompressedImage()
    uv_coordinates: list[UVCoordinate] = Field(default_factory=list[UVCoordinate])
    text: String = ""
    mesh_resource: String = ""
    mesh_file: MeshFile = MeshFile()
    mesh_use_embedded_materials: Bool = False


class MarkerArray(Message):
    """Markers to add, change or delete, in this order."""

    ros_type: ClassVar[str] = "visualization_msgs/msg/MarkerArray"
    markers: Annotated[list[Marker], Field(max_length=MOST_MARKERS)] = Field(default_factory=list[Marker])
