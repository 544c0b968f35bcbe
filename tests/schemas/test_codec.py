from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from schemas.codec import (
    MAX_MESSAGE_BYTES,
    decode,
    encode,
    message_type,
    message_types,
    rihs01,
    ros2msg_definition,
)
from schemas.errors import MessageError
from schemas.message import Message, msg_text
from schemas.ros import BoolMessage, Float64Message, JointState, PoseStamped, StringMessage
from schemas.trocar_msgs import GrantMessage
from schemas.visualization import ColorRGBA, MarkerArray
from tests.strategies import MODELS, messages, of_each_type

# parts of services are not recorded
TYPES = sorted(name for name in message_types() if "/srv/" not in name)
STANDARD = sorted(name for name in message_types() if not name.startswith(("crtk_msgs/", "trocar_msgs/")))


def same(one: Message, other: Message) -> bool:
    return type(one) is type(other) and all(
        _same(getattr(one, name), getattr(other, name)) for name in type(one).model_fields
    )


def _same(one: object, other: object) -> bool:
    if isinstance(one, Message) and isinstance(other, Message):
        return same(one, other)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_same, one, other))
    return one == other


@of_each_type
@given(st.data())
def test_every_message_comes_back_from_cdr_and_json(data: st.DataObject) -> None:
    for model in MODELS:
        message = data.draw(messages(model), model.ros_type)
        assert same(decode(model, encode(message)), message)
        assert same(model.model_validate_json(message.model_dump_json()), message)


@of_each_type
@given(st.data())
def test_bytes_are_a_message_or_a_message_error(data: st.DataObject) -> None:
    for model in MODELS:
        payload = data.draw(st.binary(max_size=200), model.ros_type)
        for start in (b"", b"\0\1\0\0", b"\0\0\0\0"):
            with contextlib.suppress(MessageError):
                assert isinstance(decode(model, start + payload), model)


@of_each_type
@given(st.data())
def test_a_changed_or_cut_message_is_a_message_or_a_message_error(data: st.DataObject) -> None:
    for model in MODELS:
        payload = bytearray(encode(data.draw(messages(model), model.ros_type)))
        cut = data.draw(st.integers(0, len(payload) - 1))
        with pytest.raises(MessageError):
            decode(model, bytes(payload[:cut]))
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
        with contextlib.suppress(MessageError):
            decode(model, bytes(payload))


@of_each_type
@given(st.binary(min_size=8, max_size=64), st.data())
def test_bytes_behind_a_message_are_refused(rest: bytes, data: st.DataObject) -> None:
    for model in MODELS:
        message = data.draw(messages(model), model.ros_type)
        with pytest.raises(MessageError):
            decode(model, encode(message) + rest)


def test_a_payload_over_the_limit_is_refused_unread() -> None:
    with pytest.raises(MessageError, match="exceed the limit"):
        decode(StringMessage, bytes(MAX_MESSAGE_BYTES + 1))


def test_a_sequence_that_claims_more_than_there_is() -> None:
    grant = bytearray(encode(GrantMessage(run=1, epoch=0, step=0, start_ns=0, horizon_ns=1)))
    grant[-4:] = b"\xff\xff\xff\xff"
    with pytest.raises(MessageError):
        decode(GrantMessage, bytes(grant))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused_from_the_wire(bad: float) -> None:
    payload = encode(Float64Message(data=1.5)).replace(np.float64(1.5).tobytes(), np.float64(bad).tobytes())
    with pytest.raises(MessageError, match="data: Input should be a finite number"):
        decode(Float64Message, payload)
    payload = encode(JointState(position=np.array([1.5]))).replace(
        np.float64(1.5).tobytes(), np.float64(bad).tobytes()
    )
    with pytest.raises(MessageError, match=r"position: .*every number must be finite"):
        decode(JointState, payload)


def test_the_error_names_the_field() -> None:
    payload = encode(PoseStamped()).replace(np.float64(1).tobytes(), np.float64(np.nan).tobytes())
    with pytest.raises(MessageError, match=r"geometry_msgs/msg/PoseStamped: pose\.orientation\.w: "):
        decode(PoseStamped, payload)


def test_an_unknown_type_is_told_with_a_near_miss() -> None:
    with pytest.raises(MessageError, match=r"Did you mean 'sensor_msgs/msg/JointState'"):
        message_type("sensor_msgs/msg/JointStates")


def test_standard_types_are_those_of_ros_2() -> None:
    theirs = get_typestore(Stores.ROS2_JAZZY).fielddefs
    ours = {name: get_types_from_msg(msg_text(message_types()[name]), name)[name][1] for name in STANDARD}
    assert ours == {name: theirs[name][1] for name in STANDARD}


def test_hashes_follow_from_the_derived_text_alone() -> None:
    store, ros_2 = get_typestore(Stores.EMPTY), get_typestore(Stores.ROS2_JAZZY)
    for name in TYPES:
        store.register(get_types_from_msg(msg_text(message_types()[name]), name))
    assert {name: rihs01(name) for name in TYPES} == {name: store.hash_rihs01(name) for name in TYPES}
    assert {name: rihs01(name) for name in STANDARD} == {name: ros_2.hash_rihs01(name) for name in STANDARD}


def test_a_published_hash() -> None:
    """The hash of std_msgs/msg/String, as `ros2 topic info --verbose` prints it."""
    assert (
        rihs01("std_msgs/msg/String")
        == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


def test_definitions_are_complete() -> None:
    for name in TYPES:
        own, *others = ros2msg_definition(name).split("=" * 80)
        assert name in get_types_from_msg(own, name)
        assert all(part.strip().startswith("MSG: ") for part in others), name


def test_every_model_has_its_own_ros_type() -> None:
    assert all(model.ros_type == name for name, model in message_types().items())
    assert message_type("std_msgs/msg/Bool") is BoolMessage


def test_crtk_types_are_those_that_crtk_publishes() -> None:
    """collaborative-robotics/crtk_msgs, msg/CartesianImpedance.msg and the others."""
    sides = [f"{part}_{side}" for part in ("position", "orientation") for side in ("positive", "negative")]
    parts = [
        ("geometry_msgs/Pose", "pose"),
        ("geometry_msgs/Twist", "twist"),
        ("geometry_msgs/Wrench", "wrench"),
    ]
    published = {
        "crtk_msgs/msg/CartesianImpedanceHalfPlaneGains": "".join(
            f"geometry_msgs/Vector3 {name}\n" for name in ("p", "d", "bias", "deadband")
        ),
        "crtk_msgs/msg/CartesianImpedance": (
            "std_msgs/Header header\ngeometry_msgs/Quaternion force_orientation\ngeometry_msgs/Vector3"
            " force_position\ngeometry_msgs/Quaternion torque_orientation\n"
            + "".join(f"crtk_msgs/CartesianImpedanceHalfPlaneGains {side}\n" for side in sides)
        ),
        "crtk_msgs/msg/CartesianState": (
            "std_msgs/Header header\n"
            + "".join(f"{type_} {name}\nstd_msgs/Bool {name}_is_valid\n" for type_, name in parts)
        ),
        "crtk_msgs/msg/OperatingState": "std_msgs/Header header\nstring state\nbool is_homed\nbool is_busy\n",
        "crtk_msgs/msg/StringStamped": "std_msgs/Header header\nstring string\n",
    }
    assert {name: msg_text(message_type(name)) for name in published} == published


def test_a_first_sequence_that_is_too_long_is_refused_unread() -> None:
    payload = b"\0\1\0\0" + (10_000).to_bytes(4, "little")
    with pytest.raises(MessageError, match="10000 markers, allowed are at most 4000 in one message"):
        decode(MarkerArray, payload)


def test_a_single_precision_number_is_what_arrives_of_it() -> None:
    assert ColorRGBA(r=0.1).r == float(np.float32(0.1))
    assert ColorRGBA(r=0.1).r != 0.1
    with pytest.raises(ValidationError, match="beyond the range of float32"):
        ColorRGBA(r=1e300)
