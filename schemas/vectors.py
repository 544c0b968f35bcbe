"""Values of signal ports as float64 vectors, and their CDR form without going through message objects.

Size, names and frame fix the layout of a port's message: only the stamp and the blocks of doubles change from
step to step. `VectorCodec` writes stamp and blocks into an encoded template (3 us against 28 us through the
models, `bench/mujoco_engine_cost.py` on a slow machine), and reads blocks after a comparison of all other
bytes.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property, reduce
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from schemas.codec import encode, message_type
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import (
    AccelStamped,
    Float64Message,
    Float64MultiArray,
    Header,
    JointState,
    MultiArrayDimension,
    MultiArrayLayout,
    PoseStamped,
    Time,
    TwistStamped,
    WrenchStamped,
)

__all__ = ["Vector", "VectorCodec", "has_vector", "join_parts"]

Vector = NDArray[np.float64]

_XYZ, _XYZW = ("x", "y", "z"), ("x", "y", "z", "w")
_LAYOUTS: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    Float64Message.ros_type: (("data", ()),),
    Float64MultiArray.ros_type: (("data", ()),),
    PoseStamped.ros_type: (("pose.position", _XYZ), ("pose.orientation", _XYZW)),
    TwistStamped.ros_type: (("twist.linear", _XYZ), ("twist.angular", _XYZ)),
    WrenchStamped.ros_type: (("wrench.force", _XYZ), ("wrench.torque", _XYZ)),
    AccelStamped.ros_type: (("accel.linear", _XYZ), ("accel.angular", _XYZ)),
    JointState.ros_type: (),
}
"""Blocks of numbers by ROS type, each with the names of the elements; no names: an array or a number."""

_QUATERNION_TOLERANCE = 1e-3
_NANOSEC = struct.Struct("<I")
_NONE: Vector = np.zeros(0)


def has_vector(type_name: str) -> bool:
    """Return whether values of a ROS type are vectors."""
    return type_name in _LAYOUTS


def join_parts(parts: Iterable[bytes | memoryview | Vector]) -> bytes:
    """Return the bytes of `parts`, one after the other."""
    held = tuple(parts)
    try:
        return b"".join(cast("tuple[bytes, ...]", held))  # a quarter of the cost of np.concatenate
    except TypeError:  # one is not contiguous
        return b"".join([part if isinstance(part, bytes) else part.tobytes() for part in held])


class VectorCodec:
    """The vector form of one port: `size` numbers, `fields` by name, to and from CDR and message models."""

    def __init__(self, port: Port) -> None:
        """Find the layout of `port`; raises MessageError if values of the port's type are not vectors."""
        if not has_vector(port.type):
            raise MessageError(f"port '{port.name}': values of {port.type} are not vectors")
        self.port = port
        self.model = message_type(port.type)
        self.fields: dict[str, slice] = {}
        """Positions of blocks and named numbers in the vector, by full path and by the block's last word:
        `position`, `position.z`.
        """
        self._blocks = list(self._layout())
        self.size: int = self._blocks[-1][2].stop
        self.neutral = np.zeros(self.size)
        """Value of an unset port: zeros, and the unit quaternion."""
        self._is_pose = "pose.orientation" in self.fields
        if self._is_pose:
            self.neutral[6] = 1.0
        self._has_stamp = "header" in self.model.model_fields
        self._compile_layout()

    def _layout(self) -> Iterator[tuple[str, tuple[str, ...], slice]]:
        port, at = self.port, 0
        if port.type == JointState.ros_type:
            rows = tuple((field, (), max(len(port.names), port.size)) for field in port.fields)
        else:
            rows = tuple((path, names, len(names) or port.size) for path, names in _LAYOUTS[port.type])
        for path, names, count in rows:
            block = slice(at, at + count)
            for field in (path, path.rpartition(".")[2]):
                self.fields[field] = block
                self.fields |= {f"{field}.{name}": slice(i, i + 1) for i, name in enumerate(names, at)}
            yield path, names, block
            at += count

    @cached_property
    def parts(self) -> dict[str, slice]:
        """Positions of the blocks, by the block's last word: `position`, `orientation`."""
        return {name: at for name, at in self.fields.items() if "." not in name}

    @cached_property
    def columns(self) -> dict[str, int]:
        """Position of each number by name: `position.x`, `velocity.insertion`, `data.0`."""
        found: dict[str, int] = {}
        for block, at in self.parts.items():
            width = at.stop - at.start
            known = [name for name in self.fields if name.startswith(f"{block}.")]
            joints = [f"{block}.{joint}" for joint in self.port.names]
            numbered = [f"{block}.{i}" for i in range(width)] if width > 1 else [block]
            found |= dict(zip(known or joints or numbered, range(at.start, at.stop), strict=True))
        return found

    def _compile_layout(self) -> None:
        """Find the positions of the stamp and the blocks in the CDR bytes, by encoding unique numbers."""
        marks: Vector = np.random.default_rng(0).random(self.size)
        template = bytearray(encode(self.to_message(marks, 0)))
        starts = [
            (template.index(struct.pack("<d", marks[block.start])), 8 * block.start, 8 * block.stop)
            for _, _, block in self._blocks
        ]
        self.spans = [(start, start + end - begin, slice(begin, end)) for start, begin, end in starts]
        """Begin and end of each block in the message, and the block's bytes in the vector."""
        self.stamp = slice(4, 12) if self._has_stamp else None
        """Bytes of the stamp in the message: seconds (int32) and nanoseconds (uint32)."""
        self._fixed: list[tuple[int, int, bytes]] = []
        at = 0
        for start, stop in [
            *sorted((start, stop) for start, stop, _ in self.spans),
            (len(template), len(template)),
        ]:
            if at == 0 and self._has_stamp:
                self._fixed.append((0, 4, bytes(template[0:4])))
                at = 12
            self._fixed.append((at, start, bytes(template[at:start])))
            at = stop
        self.template = bytes(template)
        """Message in CDR, with stamp and blocks to be filled in."""
        self._length = len(template)

    def encode(self, value: Vector, time_ns: int) -> bytes:
        """Return `value`, shape (size,), as CDR with stamp `time_ns`."""
        buffer = bytearray(self.template)
        if self._has_stamp:
            struct.pack_into("<iI", buffer, 4, *divmod(time_ns, 10**9))
        raw = value.tobytes()
        for start, stop, block in self.spans:
            buffer[start:stop] = raw[block]
        return bytes(buffer)

    def decode(self, payload: bytes) -> Vector:
        """Return the vector, shape (size,), in CDR bytes written by a `VectorCodec` of the same port.

        Raises MessageError on another length, frame, name or layout and on numbers that are not finite.
        """
        if len(payload) != self._length:
            raise MessageError(
                f"port '{self.port.name}': {len(payload)} bytes, a {self.port.type} here has {self._length}"
            )
        found = self.find_vector(payload)
        if found is None:
            raise MessageError(
                f"port '{self.port.name}': frame, names or layout differ from what the port declares"
            )
        return found

    def find_vector(self, payload: bytes) -> Vector | None:
        """Return the vector, shape (size,), in bytes that fit; otherwise None.

        Raises MessageError for numbers that are not valid.
        """
        if not self.fits(payload):
            return None
        # a third of the cost of np.concatenate
        numbers = bytearray().join([payload[start:stop] for start, stop, _ in self.spans])
        return self.check_vector(np.frombuffer(numbers))

    def unpack(self, numbers: bytes) -> Vector:
        """Return the vector, shape (size,), of the bytes of its numbers; raises MessageError if invalid."""
        if len(numbers) != self.neutral.nbytes:
            raise MessageError(
                f"port '{self.port.name}': {len(numbers)} bytes of numbers, expected {self.neutral.nbytes}"
            )
        return self.check_vector(np.frombuffer(numbers))

    def decode_all(self, payloads: Sequence[bytes]) -> NDArray[np.float64]:
        """Return the vectors, shape (n, size), in the CDR bytes of many messages.

        Raises MessageError where `decode` does.
        """
        if any(len(payload) != self._length for payload in payloads):
            raise MessageError(f"port '{self.port.name}': messages of several lengths")
        table = np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, self._length)  # (n, bytes)
        if any(
            (table[:, start:stop] != np.frombuffer(same, np.uint8)).any() for start, stop, same in self._fixed
        ):
            raise MessageError(
                f"port '{self.port.name}': frame, names or layout differ from what the port declares"
            )
        if self._has_stamp and (np.ascontiguousarray(table[:, 8:12]).view("<u4") >= 10**9).any():
            raise MessageError(f"port '{self.port.name}': a stamp of more than 999999999 ns")
        numbers = np.concatenate([table[:, start:stop] for start, stop, _ in self.spans], axis=1)
        values = numbers.view(np.float64)  # (n, size)
        if not np.isfinite(values).all():
            raise MessageError(f"port '{self.port.name}': not all values are finite")
        norms = np.linalg.norm(values[:, 3:], axis=1) if self._is_pose else np.ones(1)
        if (abs(norms - 1.0) > _QUATERNION_TOLERANCE).any():
            raise MessageError(f"port '{self.port.name}': a quaternion (x, y, z, w) that has not the norm 1")
        return values

    def fits(self, payload: bytes) -> bool:
        """Return whether the bytes are the template with other numbers and another valid stamp."""
        if len(payload) != self._length or (
            self._has_stamp and not _NANOSEC.unpack_from(payload, 8)[0] < 10**9
        ):
            return False
        for start, stop, expected in self._fixed:  # noqa: SIM110 - a generator would double the cost
            if payload[start:stop] != expected:
                return False
        return True

    def check_vector(self, value: Vector) -> Vector:
        """Return a valid `value`: float64 of shape (size,), finite, quaternions of norm 1."""
        try:
            fits = value.shape == (self.size,) and value.dtype == np.float64
        except AttributeError:  # no array
            fits = False
        if not fits:
            is_array = hasattr(value, "dtype") and hasattr(value, "shape")
            what = f"{value.dtype} of shape {value.shape}" if is_array else f"a {type(value).__name__}"
            raise MessageError(
                f"port '{self.port.name}': {what}, expected float64 of shape ({self.size},)"
                + ("" if is_array else ": numpy.array([...], float)")
            )
        if 0 in np.isfinite(value).tobytes():  # a third of the cost of np.isfinite(...).all()
            raise MessageError(f"port '{self.port.name}': not all of {value} are finite")
        if self._is_pose and abs((norm := math.hypot(*value[3:].tolist())) - 1.0) > _QUATERNION_TOLERANCE:
            raise MessageError(
                f"port '{self.port.name}': quaternion (x, y, z, w) has norm {norm:.6g}, expected 1"
            )
        return value

    def to_message(self, value: Vector, time_ns: int) -> Message:
        """Return `value`, shape (size,), as a message; a JointState is not validated."""
        if self.port.type == JointState.ros_type:
            return self._joint_state(value, time_ns)
        tree: dict[str, Any] = {}
        if self._has_stamp:
            tree["header"] = Header(stamp=Time.from_ns(time_ns), frame_id=self.port.frame)
        if self.port.shape:
            tree["layout"] = _layout_of(self.port.shape)
        for path, names, block in self._blocks:
            *parents, leaf = path.split(".")
            numbers = value[block]
            content: Any = dict(zip(names, numbers.tolist(), strict=True)) if names else numbers.copy()
            if self.port.type == Float64Message.ros_type:
                content = float(numbers[0])
            reduce(lambda node, key: node.setdefault(key, {}), parents, tree)[leaf] = content
        return self.model.model_validate(tree)

    def _joint_state(self, value: Vector, time_ns: int) -> JointState:
        """Return a JointState, without validation: the vector was checked by its sender.

        An arm's controller receives commands in this form in every step.
        """
        numbers = {path: value[block].copy() for path, _, block in self._blocks}
        header = Header(stamp=Time.from_ns(time_ns), frame_id=self.port.frame)
        return JointState.model_construct(
            header=header,
            name=list(self.port.names),
            position=numbers.get("position", _NONE),
            velocity=numbers.get("velocity", _NONE),
            effort=numbers.get("effort", _NONE),
        )

    def from_message(self, message: Message) -> Vector:
        """Return the vector, shape (size,), of a validated message from outside.

        Named joints may come in any order. Raises MessageError if frame, names or sizes do not fit the port.
        """
        if not isinstance(message, self.model):
            raise MessageError(f"port '{self.port.name}': {message.ros_type}, expected {self.port.type}")
        header = getattr(message, "header", None)
        frame = header.frame_id if isinstance(header, Header) else ""
        if self.port.frame and frame and frame != self.port.frame:
            raise MessageError(f"port '{self.port.name}': frame '{frame}', expected '{self.port.frame}'")
        value = np.empty(self.size)
        for path, names, block in self._blocks:
            content: Any = reduce(getattr, path.split("."), message)
            numbers = (
                np.array([getattr(content, name) for name in names])
                if names
                else np.atleast_1d(np.asarray(content, np.float64))
            )
            if numbers.size != block.stop - block.start:
                raise MessageError(
                    f"port '{self.port.name}': {numbers.size} values in {path}, expected"
                    f" {block.stop - block.start}"
                )
            value[block] = (
                numbers[self._joint_order(message)] if path in ("position", "velocity", "effort") else numbers
            )
        return self.check_vector(value)

    def _joint_order(self, message: Message) -> Any:
        names: list[str] = getattr(message, "name", [])
        if not names or tuple(names) == self.port.names:
            return slice(None)
        if sorted(names) != sorted(self.port.names):
            raise MessageError(f"port '{self.port.name}': joints {names}, expected {list(self.port.names)}")
        return [names.index(name) for name in self.port.names]


def _layout_of(shape: tuple[int, ...]) -> MultiArrayLayout:
    """Return the layout of a dense array, row-major.

    The stride of a dimension is the number of elements from this dimension on (std_msgs/MultiArrayLayout).
    """
    labels = ("rows", "cols") if len(shape) == 2 else tuple(f"dim{axis}" for axis in range(len(shape)))
    rows = zip(labels, shape, strict=True)
    return MultiArrayLayout(
        dim=[
            MultiArrayDimension(label=label, size=size, stride=math.prod(shape[axis:]))
            for axis, (label, size) in enumerate(rows)
        ]
    )
