from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError

from schemas.message import (
    Bytes,
    Float32Array,
    Float64Array,
    Int32Array,
    Message,
    UInt8,
    UInt64Array,
    fixed_float64,
    msg_text,
)
from schemas.ros import Float64Message, Header, JointState, Time


class Sample(Message):
    ros_type: ClassVar[str] = "trocar_msgs/msg/Sample"
    header: Header = Header()
    headers: list[Header] = []  # noqa: RUF012
    level: UInt8 = 0
    raw: Bytes = np.zeros(0, np.uint8)
    small: Int32Array = np.zeros(0, np.int32)
    big: UInt64Array = np.zeros(0, np.uint64)
    single: Float32Array = np.zeros(0, np.float32)
    double: Float64Array = np.zeros(0)
    matrix: Annotated[NDArray[np.float64], fixed_float64(4)] = np.zeros(4)


def test_msg_text_is_derived_from_the_model() -> None:
    assert (
        msg_text(Sample)
        == "std_msgs/Header header\nstd_msgs/Header[] headers\nuint8 level\nuint8[] raw\nint32[] small\n"
        "uint64[] big\nfloat32[] single\nfloat64[] double\nfloat64[4] matrix\n"
    )


def test_a_field_that_stands_for_no_ros_type() -> None:
    class Bad(Message):
        ros_type: ClassVar[str] = "trocar_msgs/msg/Bad"
        value: complex = 0j

    with pytest.raises(TypeError, match=r"Bad\.value"):
        msg_text(Bad)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("raw", [256]),
        ("raw", np.array([-1])),
        ("raw", np.array([256])),
        ("raw", b"abc"),
        ("raw", [1.5]),
        ("raw", [np.nan]),
        ("small", [2**31]),
        ("small", np.array([0.5])),
        ("small", ["1"]),
        ("small", [None]),
        ("small", [[1, 2], [3]]),
        ("big", [-1]),
        ("big", [2**64]),
        ("single", [1e39]),
        ("single", [np.inf]),
        ("double", [np.nan]),
        ("double", 1.0),
        ("double", [[1.0]]),
        ("double", "1.0"),
        ("double", {"a": 1}),
        ("double", [1j]),
        ("double", None),
        ("matrix", [1, 2, 3]),
        ("level", 256),
        ("level", -1),
        ("none", 1),
    ],
)
def test_values_out_of_range_or_shape_are_refused(field: str, value: Any) -> None:
    with pytest.raises(ValidationError):
        Sample.model_validate({field: value})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("raw", [0, 255]),
        ("small", np.array([1.0, -2.0])),
        ("big", [0, 2**64 - 1]),
        ("single", [0.5]),
        ("double", [1, 2]),
        ("matrix", range(4)),
    ],
)
def test_what_has_an_exact_place_is_taken(field: str, value: Any) -> None:
    taken = getattr(Sample.model_validate({field: value}), field)
    assert taken.dtype == getattr(Sample(), field).dtype
    assert np.array_equal(taken, np.asarray(value))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_must_be_finite(bad: float) -> None:
    with pytest.raises(ValidationError):
        Float64Message(data=bad)
    with pytest.raises(ValidationError):
        JointState(position=np.array([0.0, bad]))


def test_messages_are_frozen() -> None:
    with pytest.raises(ValidationError):
        Float64Message(data=1.0).data = 2.0  # type: ignore[misc]


def test_defaults_are_not_shared() -> None:
    one = JointState()
    one.name.append("a")
    assert JointState().name == []


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_time_splits_and_joins_nanoseconds(time_ns: int) -> None:
    time = Time.from_ns(time_ns)
    assert time.ns == time_ns
    assert 0 <= time.nanosec < 10**9


@pytest.mark.parametrize("time_ns", [2**31 * 10**9, -(2**31) * 10**9 - 1])
def test_time_that_ros_cannot_hold(time_ns: int) -> None:
    with pytest.raises(ValidationError):
        Time.from_ns(time_ns)
