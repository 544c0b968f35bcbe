"""The compiled encoder against `rosbags`: every byte, and everything that it leaves to it."""

import struct
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas import codec
from schemas.codec import encode, encode_as
from schemas.errors import MessageError
from schemas.ros import Float64Message, Header, JointState, StringMessage, Time
from schemas.trocar_msgs import AckMessage, SoftBodyState
from tests.strategies import MODELS, messages, of_each_type

pytestmark = pytest.mark.skipif(codec.compiled is None, reason="built without a compiler")

ERRORS = struct.error, AttributeError, TypeError, ValueError
JOINTS = JointState(name=["yaw", "pitch"], position=np.array([1.0, 2.0]))


def with_position(position: object) -> JointState:
    return JOINTS.model_copy(update={"position": position})


def encoder(*fields, lists=False):
    return codec.compiled.Encoder(list(fields), lists=lists)


@of_each_type
@given(st.data())
def test_every_message_has_the_same_bytes(data: st.DataObject) -> None:
    for model in MODELS:
        message = data.draw(messages(model), model.ros_type)
        expected = codec._by_rosbags(message)
        assert codec._encoder(model, lists=False).encode(message) == expected
        assert encode_as(model, message) == expected


def test_a_long_message_has_the_same_bytes():
    header = Header(frame_id="\N{GREEK SMALL LETTER ALPHA}" * 999)
    body = SoftBodyState(header=header, body="b", nodes_m=np.arange(30_000, dtype=np.float32))
    assert encode(body) == codec._by_rosbags(body)


@pytest.mark.parametrize(
    "position",
    [
        [1.0, 2.0],
        (1.0, 2.0),
        b"12345678",
        None,
        np.float64(1.0),
        np.array([1, 2]),
        np.array([1.0], np.float32),
        np.array([1.0], ">f8"),
        np.array([1.0, 2.0, 3.0])[::2],
        np.zeros((2, 2)),
        np.zeros(()),
    ],
)
def test_what_is_no_array_of_the_field_is_left_to_rosbags(position):
    assert codec._encoder(JointState, lists=False).encode(with_position(position)) is None


@pytest.mark.parametrize(
    "message",
    [
        Time.model_construct(sec=2**31, nanosec=0),
        Time.model_construct(sec=-(2**31) - 1, nanosec=0),
        Time.model_construct(sec=0, nanosec=-1),
        Time.model_construct(sec=0, nanosec=2**32),
        Time.model_construct(sec=2**70, nanosec=0),
        Time.model_construct(sec=1.0, nanosec=0),
        StringMessage.model_construct(data=b"bytes"),
        StringMessage.model_construct(data="\ud800"),
        Float64Message.model_construct(data="1.0"),
        JOINTS.model_copy(update={"name": ["yaw", 1]}),
        JOINTS.model_copy(update={"name": 7}),
        JOINTS.model_copy(update={"header": None}),
    ],
)
def test_what_no_such_message_has_is_an_error_of_rosbags(message):
    assert codec._encoder(type(message), lists=False).encode(message) is None
    with pytest.raises(ERRORS) as by_rosbags:
        codec._by_rosbags(message)
    with pytest.raises(by_rosbags.type):
        encode(message)


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        ("?", True, b"\1"),
        ("b", -128, b"\x80"),
        ("b", 128, None),
        ("B", 255, b"\xff"),
        ("B", 256, None),
        ("i", -(2**31), b"\0\0\0\x80"),
        ("I", 2**32 - 1, b"\xff" * 4),
        ("q", -(2**63), b"\0" * 7 + b"\x80"),
        ("q", 2**63, None),
        ("Q", 2**64 - 1, b"\xff" * 8),
        ("Q", -1, None),
        ("f", 0.5, b"\0\0\0\x3f"),
        ("f", 1e39, None),
        ("f", float("inf"), b"\0\0\x80\x7f"),
        ("d", 1, b"\0" * 6 + b"\xf0\x3f"),
        ("d", None, None),
        ("s", "a", b"\2\0\0\0a\0"),
    ],
)
def test_a_number_is_as_wide_as_its_kind_or_left_alone(kind, value, expected):
    found = encoder(("x", kind, -1, None)).encode(SimpleNamespace(x=value))
    assert found == (None if expected is None else b"\0\1\0\0" + expected)


def test_arrays_of_fixed_length_have_no_length_and_no_other_length():
    fixed = encoder(("x", "B", 2, None), ("names", "s", 1, None))
    values = SimpleNamespace(x=np.array([1, 2], np.uint8), names=["a"])
    assert fixed.encode(values) == b"\0\1\0\0" + b"\1\2\0\0" + b"\2\0\0\0a\0"
    for other in ({"x": np.zeros(3, np.uint8)}, {"names": ["a", "b"]}):
        assert fixed.encode(SimpleNamespace(**vars(values) | other)) is None


def test_lists_of_numbers_are_arrays_only_where_they_are_asked_for():
    with pytest.raises(AttributeError):
        encode(with_position([1.0, 2.0]))
    assert encode_as(JointState, with_position([1.0, 2.0])) == encode(JOINTS)


@pytest.mark.parametrize("compiled", [True, False])
def test_values_of_the_step_loop_are_a_message_with_and_without_a_compiler(compiled, monkeypatch):
    values = SimpleNamespace(
        run=2**63, epoch=0, step=3, state_hash=[2**64 - 1], compute_ns=(5,), work_j=[0.5], error=""
    )
    if not compiled:
        monkeypatch.setattr(codec, "_encoder", lambda *_, **__: None)
    found = encode_as(AckMessage, values)
    assert codec.decode(AckMessage, found).state_hash.tolist() == [2**64 - 1]
    with pytest.raises(MessageError, match="epoch"):
        encode_as(AckMessage, SimpleNamespace(**vars(values) | {"epoch": -1}))


@pytest.mark.parametrize(
    ("field", "error"),
    [
        (("x", "?", -2, None), ValueError),
        (("x", "z", -1, None), ValueError),
        (("x", "\N{EURO SIGN}", -1, None), ValueError),
        (("x", "m", -1, None), ValueError),
        (("x", "m", -1, "text"), ValueError),
        (("x", "d", -1), TypeError),
        ((1, "d", -1, None), TypeError),
        (("x", "dd", -1, None), TypeError),
    ],
)
def test_what_is_no_field_is_refused(field, error):
    with pytest.raises(error):
        encoder(field)


def test_nothing_is_kept_of_what_was_encoded_or_left_alone():
    taken, refused = with_position(np.array([1.0])), with_position([1.0])
    one = codec._encoder(JointState, lists=False)
    held = [taken, taken.header, taken.position, taken.name, refused, refused.position]
    before = [sys.getrefcount(value) for value in held]
    for _ in range(1000):
        one.encode(taken)
        one.encode(refused)
    assert [sys.getrefcount(value) for value in held] == before
