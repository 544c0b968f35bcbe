"""DDS types from ROS types, with messages in CDR as samples: nothing is serialised twice.

Cyclone DDS announces the type of every topic and accepts only bytes of this type. The whole definition comes
from the type store of our models.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Self

from cyclonedds.idl import IdlStruct, make_idl_struct, types
from rosbags.interfaces import Nodetype

from schemas.codec import typestore

__all__ = ["Payload", "payload_type"]

_BASES: dict[str, Any] = {
    "bool": bool,
    "string": str,
    "octet": types.uint8,
    "char": types.uint8,
    **{
        name: getattr(types, name)
        for name in (
            "byte",
            "int8",
            "uint8",
            "int16",
            "uint16",
            "int32",
            "uint32",
            "int64",
            "uint64",
            "float32",
            "float64",
        )
    },
}


class Payload(IdlStruct):
    """A message in its form on the wire."""

    def __init__(self, cdr: bytes) -> None:
        """`cdr`: the message with encapsulation header."""
        self.cdr = cdr

    def serialize(
        self,
        buffer: object = None,  # noqa: ARG002
        endianness: object = None,  # noqa: ARG002
        use_version_2: bool | None = None,  # noqa: ARG002
    ) -> bytes:
        """Return the message as it is."""
        return self.cdr

    @classmethod
    def deserialize(cls, data: bytes, has_header: bool = True, use_version_2: bool | None = None) -> Self:  # noqa: ARG003
        """Return the message as it is."""
        return cls(data)

    @classmethod
    def deserialize_key(cls, data: bytes, has_header: bool = True, use_version_2: bool | None = None) -> Self:  # noqa: ARG003
        """Return the key of a disposed instance, without a message."""
        return cls(data)


@cache
def payload_type(ros_type: str) -> type[Payload]:
    """Return the type of messages of `sensor_msgs/msg/JointState`."""
    return make_idl_struct(
        _class_name(ros_type), _dds_name(ros_type), _fields(ros_type), dataclassify=False, bases=(Payload,)
    )


@cache
def _idl_struct(ros_type: str) -> type[IdlStruct]:
    return make_idl_struct(_class_name(ros_type), _dds_name(ros_type), _fields(ros_type))


def _fields(ros_type: str) -> dict[str, Any]:
    return {name: _type(described) for name, described in typestore().fielddefs[ros_type][1]}


def _type(described: Any) -> Any:
    """Return the type of a field from the description of rosbags; bounds and lengths are 0 if missing."""
    kind, of = described
    if kind == Nodetype.NAME:
        return _idl_struct(of)
    if kind == Nodetype.BASE:
        name, bound = of
        return types.bounded_str[bound] if bound else _BASES[name]
    element, length = of
    if kind == Nodetype.ARRAY:
        return types.array[_type(element), length]
    return types.sequence[_type(element), length] if length else types.sequence[_type(element)]


def _class_name(ros_type: str) -> str:
    return f"{ros_type.rpartition('/')[2]}_"


def _dds_name(ros_type: str) -> str:
    """`sensor_msgs/msg/JointState` to `sensor_msgs.msg.dds_.JointState_`, dots for colons."""
    package, group, name = ros_type.split("/")
    return f"{package}.{group}.dds_.{name}_"
