"""The base of every message: a pydantic model that is also a ROS 2 message.

A field's annotation has the field's ROS type, so the .msg text of a type is derived from the model and cannot
drift. Numbers must be finite: a NaN never leaves or enters a simulation.
"""

from __future__ import annotations

import struct
from functools import partial
from typing import Annotated, Any, ClassVar, cast, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

__all__ = [
    "Bool",
    "Byte",
    "Bytes",
    "Float32",
    "Float32Array",
    "Float64",
    "Float64Array",
    "Int32",
    "Int32Array",
    "Int64",
    "Message",
    "String",
    "StringArray",
    "UInt8",
    "UInt32",
    "UInt32Array",
    "UInt64",
    "UInt64Array",
    "field_types",
    "fixed_float64",
    "msg_text",
]

_SINGLE = struct.Struct("<f")


class RosType:
    """Marks an annotation with its ROS 2 type, an array also with its numpy type."""

    def __init__(self, name: str, dtype: Any = None) -> None:
        """Mark with the type `name`, as in a .msg file, and the element type of an array."""
        self.name = name
        self.dtype = None if dtype is None else np.dtype(dtype)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Validate arrays: one-dimensional, of the right element type and length (if fixed), finite."""
        if self.dtype is None:
            return handler(source)
        return core_schema.no_info_plain_validator_function(
            partial(self._validate_array, self.dtype),
            serialization=core_schema.plain_serializer_function_ser_schema(lambda a: a.tolist()),
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: Any) -> dict[str, Any]:
        """Arrays are JSON arrays of numbers."""
        return handler(schema) if self.dtype is None else {"type": "array", "items": {"type": "number"}}

    def _validate_array(self, dtype: np.dtype[Any], value: Any) -> NDArray[Any]:
        try:
            # Python's integers are longer than any of numpy's
            exact = dtype.kind != "f" and not isinstance(value, np.ndarray)
            given: NDArray[Any] = np.asarray(value, object if exact else None)
            if dtype.kind == "f" and given.size and given.dtype.kind not in "biuf":
                raise ValueError(f"these are {given.dtype}")
            with np.errstate(over="ignore", invalid="ignore"):
                array = given.astype(dtype, copy=False)
        except (TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"expected {self.name}: {error}") from error
        if dtype.kind != "f" and array.dtype != given.dtype and not np.array_equal(array, given):
            raise ValueError(f"expected {self.name}: a number is not whole or out of range")
        if array.ndim != 1:
            raise ValueError(f"expected {self.name}, got an array of shape {array.shape}")
        length = self.name.partition("[")[2].rstrip("]")
        if length and array.size != int(length):
            raise ValueError(f"expected {self.name}, got {array.size} values")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ValueError("every number must be finite")
        return array


def _single(value: float) -> float:
    """Round to single precision, so that sender and receiver have the same message."""
    try:
        return cast("float", _SINGLE.unpack(_SINGLE.pack(value))[0])
    except OverflowError:
        raise ValueError(f"{value:g} is beyond the range of float32") from None


Float64 = Annotated[float, Field(allow_inf_nan=False), RosType("float64")]
Float32 = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_single), RosType("float32")]
Bool = Annotated[bool, RosType("bool")]
# ROS 2 has eight bits, of which rosbags takes the eighth for a sign
Byte = Annotated[int, Field(ge=0, lt=2**7), RosType("byte")]
String = Annotated[str, RosType("string")]
UInt8 = Annotated[int, Field(ge=0, lt=2**8), RosType("uint8")]
Int32 = Annotated[int, Field(ge=-(2**31), lt=2**31), RosType("int32")]
UInt32 = Annotated[int, Field(ge=0, lt=2**32), RosType("uint32")]
Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63), RosType("int64")]
UInt64 = Annotated[int, Field(ge=0, lt=2**64), RosType("uint64")]
StringArray = Annotated[list[str], RosType("string[]")]
Bytes = Annotated[NDArray[np.uint8], RosType("uint8[]", np.uint8)]
Int32Array = Annotated[NDArray[np.int32], RosType("int32[]", np.int32)]
UInt32Array = Annotated[NDArray[np.uint32], RosType("uint32[]", np.uint32)]
UInt64Array = Annotated[NDArray[np.uint64], RosType("uint64[]", np.uint64)]
Float32Array = Annotated[NDArray[np.float32], RosType("float32[]", np.float32)]
Float64Array = Annotated[NDArray[np.float64], RosType("float64[]", np.float64)]


def fixed_float64(length: int) -> RosType:
    """Make the mark of an array field of fixed length, for use in `Annotated[NDArray[np.float64], ...]`."""
    return RosType(f"float64[{length}]", np.float64)


class Message(BaseModel):
    """A ROS 2 message. `ros_type` is its full name, such as `geometry_msgs/msg/PoseStamped`."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, from_attributes=True)

    ros_type: ClassVar[str]


def msg_text(model: type[Message]) -> str:
    """Return the .msg definition of `model`, one line a field, derived from its annotations."""
    return "".join(f"{ros_type} {name}\n" for name, ros_type in field_types(model).items())


def field_types(model: type[Message]) -> dict[str, str]:
    """Return the type of each field of `model` as a .msg file has it, such as `float64[]`, by name."""
    return {name: _field_type(model, name) for name in model.model_fields}


def _field_type(model: type[Message], name: str) -> str:
    info = model.model_fields[name]
    for mark in info.metadata:
        if isinstance(mark, RosType):
            return mark.name
    annotation: Any = info.annotation
    is_list = get_origin(annotation) is list
    element = get_args(annotation)[0] if is_list else annotation
    if not (isinstance(element, type) and issubclass(element, Message)):
        raise TypeError(f"{model.__name__}.{name}: {annotation} stands for no ROS 2 type")
    return element.ros_type.replace("/msg/", "/") + ("[]" if is_list else "")
