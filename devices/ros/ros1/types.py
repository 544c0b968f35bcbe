"""Messages and services of ROS 1: names, definitions, MD5 sums, and conversion to and from CDR.

ROS 1 aligns nothing, ends no string with a zero, and has a counter in every header. rosbags converts, with
the definitions of Noetic, where some fields have other names than in ROS 2 (`CameraInfo`); types missing in
rosbags (CRTK, tf2) are the same in both and come from our models. Fields of ROS 2 unknown to Noetic (markers)
are left out on the way to ROS 1, and empty on the way back.
"""

from __future__ import annotations

import struct
from functools import cache
from hashlib import md5

from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from schemas.codec import check_first_sequence, message_type, message_types, typestore
from schemas.errors import MessageError
from schemas.message import msg_text

__all__ = ["Wire", "checksum", "definition", "ros1_name", "service_checksum"]

_LENGTH = struct.Struct("<I")
_LENGTH_AND_COUNT = struct.Struct("<II")
_HEADER = "std_msgs/msg/Header"


@cache
def _noetic_types() -> Typestore:
    store = get_typestore(Stores.ROS1_NOETIC)
    for name, model in message_types().items():
        if name not in store.types and not name.startswith("trocar_msgs/"):
            (fields,) = get_types_from_msg(msg_text(model), name).values()
            store.register({name: fields})
    return store


def ros1_name(type_: str) -> str:
    """`sensor_msgs/msg/JointState` to `sensor_msgs/JointState`."""
    package, _, name = type_.split("/")
    return f"{package}/{name}"


def definition(type_: str) -> str:
    """Return the definition of a message and of all field types, as in connection headers and bags."""
    return _noetic_types().generate_msgdef(type_, ros_version=1)[0]


def checksum(type_: str) -> str:
    """Return the MD5 sum of a message's definition; both sides of a connection must have the same."""
    return _noetic_types().generate_msgdef(type_, ros_version=1)[1]


def service_checksum(type_: str) -> str:
    """Return the MD5 sum of a service: over the texts of request and response (genmsg, gentools.py)."""
    return md5(
        (_sum_definition(f"{type_}_Request") + _sum_definition(f"{type_}_Response")).encode(),
        usedforsecurity=False,
    ).hexdigest()


def _sum_definition(type_: str) -> str:
    """Return the text for the sum: the definition, with sums in place of message types."""
    lines = definition(type_).partition("=" * 80)[0].strip().splitlines()
    return "\n".join(_summed_line(*line.split(" ", 1)) for line in lines)


def _summed_line(kind: str, name: str) -> str:
    package, _, short = kind.removesuffix("[]").partition("/")
    return f"{checksum(f'{package}/msg/{short}')} {name}" if short else f"{kind} {name}"


class Wire:
    """Converts messages of a type to frames of ROS 1 (length in four bytes, message), and back."""

    def __init__(self, type_: str) -> None:
        """`type_`: type as in our models, `sensor_msgs/msg/JointState`."""
        self._type, self._store = type_, typestore()
        fields = self._store.fielddefs[type_][1]
        self._counted = bool(fields) and fields[0][1][1] == _HEADER
        self._is_same = is_same_wireformat(_noetic_types(), self._store, type_, type_)
        self._defaults: dict[str, object] = {}
        """Defaults of rosbags for fields missing on a side, by type."""

    def frame(self, cdr: bytes, count: int) -> bytearray:
        """Return the frame of a message; `count`: sequence number for the header, if any."""
        message = (
            self._store.cdr_to_ros1(memoryview(cdr), self._type)
            if self._is_same
            else self._migrate_message(cdr, to_ros2=False)
        )
        frame = bytearray(_LENGTH.size + len(message))
        frame[_LENGTH.size :] = message
        if self._counted:
            _LENGTH_AND_COUNT.pack_into(frame, 0, len(message), count & 0xFFFFFFFF)
        else:
            _LENGTH.pack_into(frame, 0, len(message))
        return frame

    def cdr(self, message: bytes) -> bytes:
        """Return a message of ROS 1, without the length, as CDR.

        Raises MessageError for other bytes.
        """
        try:
            if not self._is_same:
                check_first_sequence(message_type(self._type), message[:4], "little")
                return bytes(self._migrate_message(message, to_ros2=True))
            return bytes(self._store.ros1_to_cdr(message, self._type))
        except (SerdeError, AssertionError, IndexError, struct.error, ValueError) as error:
            raise MessageError(
                f"{self._type}: {len(message)} bytes are no such message of ROS 1 ({error})"
            ) from error

    def _migrate_message(self, message: bytes, *, to_ros2: bool) -> memoryview:
        """Return a message in the layout of the far side, field by field: far slower than as bytes."""
        source, target = (_noetic_types(), self._store) if to_ros2 else (self._store, _noetic_types())
        return migrate_bytes(
            source,
            target,
            self._type,
            self._type,
            self._defaults,
            message,
            src_is2=not to_ros2,
            dst_is2=to_ros2,
        )
