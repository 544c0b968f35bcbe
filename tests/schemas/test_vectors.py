from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import BondSide, Port, bond_ports
from schemas.ros import Float64MultiArray, Header, JointState, PoseStamped, Twist, WrenchStamped
from schemas.vectors import VectorCodec, has_vector
from tests.strategies import ports, values

stamps = st.integers(0, 2**31 * 10**9 - 1)
JOINTS = Port(
    name="js",
    causality="output",
    type="sensor_msgs/msg/JointState",
    names=("yaw", "pitch", "insertion"),
    fields=("position", "effort"),
)
POSE = Port(name="pose", causality="output", type="geometry_msgs/msg/PoseStamped", frame="world")


@st.composite
def codecs_with_values(draw: st.DrawFn) -> tuple[VectorCodec, np.ndarray]:
    codec = VectorCodec(draw(ports()))
    return codec, draw(values(codec.port, codec.size))


@given(codecs_with_values(), stamps)
def test_encode_writes_the_bytes_of_the_message(drawn: tuple[VectorCodec, np.ndarray], time_ns: int) -> None:
    codec, value = drawn
    assert codec.encode(value, time_ns) == encode(codec.to_message(value, time_ns))


@given(codecs_with_values(), stamps)
def test_decode_and_from_message_are_the_way_back(
    drawn: tuple[VectorCodec, np.ndarray], time_ns: int
) -> None:
    codec, value = drawn
    payload = codec.encode(value, time_ns)
    assert codec.decode(payload).tobytes() == value.tobytes()
    assert codec.from_message(decode(codec.model, payload)).tobytes() == value.tobytes()


@given(ports(), st.binary(max_size=300))
def test_other_bytes_are_refused(port: Port, payload: bytes) -> None:
    with pytest.raises(MessageError, match=port.name):
        VectorCodec(port).decode(payload)


@given(codecs_with_values(), st.data())
def test_a_changed_byte_is_a_changed_number_or_refused(
    drawn: tuple[VectorCodec, np.ndarray], data: st.DataObject
) -> None:
    codec, value = drawn
    payload = bytearray(codec.encode(value, 0))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        decoded = codec.decode(bytes(payload))
    except MessageError:
        return
    assert codec.check_vector(decoded) is decoded
    again = bytearray(codec.encode(decoded, 0))
    if "header" in codec.model.model_fields:
        again[4:12] = payload[4:12]
    assert again == payload


@given(codecs_with_values(), st.sampled_from([np.nan, np.inf, -np.inf]), st.data())
def test_numbers_that_are_not_finite_are_refused(
    drawn: tuple[VectorCodec, np.ndarray], bad: float, data: st.DataObject
) -> None:
    codec, value = drawn
    value = value.copy()
    value[data.draw(st.integers(0, codec.size - 1))] = bad
    with pytest.raises(MessageError):
        codec.decode(codec.encode(value, 0))
    with pytest.raises(MessageError):
        codec.check_vector(value)


@given(st.permutations(JOINTS.names), st.lists(st.floats(-9, 9), min_size=6, max_size=6))
def test_named_joints_come_in_any_order(order: list[str], numbers: list[float]) -> None:
    codec, value = VectorCodec(JOINTS), np.array(numbers)
    by_name = dict(zip(JOINTS.names, zip(value[:3], value[3:], strict=True), strict=True))
    message = JointState(
        name=order,
        position=np.array([by_name[n][0] for n in order]),
        effort=np.array([by_name[n][1] for n in order]),
    )
    assert np.array_equal(codec.from_message(message), value)


@pytest.mark.parametrize(
    "names",
    [
        ["yaw", "pitch"],
        ["yaw", "pitch", "roll"],
        ["yaw", "pitch", "insertion", "insertion"],
        ["yaw", "yaw", "pitch"],
    ],
)
def test_other_joints_are_refused(names: list[str]) -> None:
    with pytest.raises(MessageError, match="expected"):
        VectorCodec(JOINTS).from_message(JointState(name=names, position=np.zeros(3), effort=np.zeros(3)))


def test_unnamed_joints_come_in_the_order_of_the_port() -> None:
    message = JointState(position=np.array([1.0, 2, 3]), effort=np.array([4.0, 5, 6]))
    assert np.array_equal(VectorCodec(JOINTS).from_message(message), [1, 2, 3, 4, 5, 6])


@pytest.mark.parametrize(
    ("port", "message", "expected"),
    [
        (POSE, PoseStamped(header=Header(frame_id="camera")), "frame 'camera', expected 'world'"),
        (POSE, PoseStamped.model_validate({"pose": {"orientation": {"w": 0.5}}}), "norm 0.5, expected 1"),
        (POSE, WrenchStamped(), "geometry_msgs/msg/WrenchStamped, expected geometry_msgs/msg/PoseStamped"),
        (POSE, Twist(), "geometry_msgs/msg/Twist, expected"),
        (JOINTS, JointState(position=np.zeros(3)), "0 values in effort, expected 3"),
        (
            Port(name="a", causality="output", size=2),
            Float64MultiArray(data=np.zeros(3)),
            "3 values in data, expected 2",
        ),
    ],
)
def test_a_message_that_does_not_fit_the_port(port: Port, message: Message, expected: str) -> None:
    with pytest.raises(MessageError, match=expected):
        VectorCodec(port).from_message(message)


def test_a_message_without_a_frame_is_taken() -> None:
    assert np.array_equal(VectorCodec(POSE).from_message(PoseStamped()), VectorCodec(POSE).neutral)


@pytest.mark.parametrize(
    "value", [np.zeros(6), np.zeros((7, 1)), np.zeros(7, np.float32), np.arange(7), np.zeros(7)]
)
def test_values_of_another_shape_or_type_are_refused(value: np.ndarray) -> None:
    with pytest.raises(MessageError, match="'pose'"):
        VectorCodec(POSE).check_vector(value)


def test_bytes_of_another_frame_are_refused() -> None:
    camera = VectorCodec(POSE.model_copy(update={"frame": "camera"}))
    tool = VectorCodec(POSE.model_copy(update={"frame": "toolin"}))
    with pytest.raises(MessageError, match="frame, names or layout differ"):
        tool.decode(camera.encode(camera.neutral, 0))


def test_fields_by_name() -> None:
    codec = VectorCodec(POSE)
    assert codec.fields["pose.position"] == codec.fields["position"] == slice(0, 3)
    assert codec.fields["pose.orientation.w"] == codec.fields["orientation.w"] == slice(6, 7)
    assert VectorCodec(JOINTS).fields["effort"] == slice(3, 6)


def test_types_without_a_vector() -> None:
    assert not has_vector("sensor_msgs/msg/Joy")
    with pytest.raises(MessageError, match="are not vectors"):
        VectorCodec(Port(name="joy", causality="output", type="sensor_msgs/msg/Joy"))


@pytest.mark.parametrize("side", ["motion", "force"])
@pytest.mark.parametrize(("dof", "points"), [(1, 1), (2, 1), (3, 1), (3, 9), (6, 1)])
def test_every_port_of_a_bond_has_a_vector(side: str, dof: int, points: int) -> None:
    bond = BondSide.model_validate(
        {"name": "tip", "side": side, "dof": dof, "points": points, "frame": "world"}
    )
    position, velocity, force = bond_ports(bond)
    assert VectorCodec(velocity).size == VectorCodec(force).size == bond.size == dof * points
    assert VectorCodec(position).size == (7 if dof == 6 else dof * points)
    assert (
        position.causality
        == velocity.causality
        == ("output" if side == "motion" else "input")
        != force.causality
    )


@pytest.mark.parametrize("dof", [1, 2, 6])
def test_only_a_bond_of_positions_in_space_has_several_points(dof: int) -> None:
    with pytest.raises(ValidationError, match="several points are for dof 3"):
        BondSide.model_validate({"name": "tip", "side": "force", "dof": dof, "points": 2})


def test_a_matrix_stands_in_the_layout_row_after_row():
    codec = VectorCodec(Port(name="jacobian", causality="output", size=12, shape=(3, 4)))
    value = np.arange(12.0)
    message = decode(Float64MultiArray, codec.encode(value, 0))
    assert [(d.label, d.size, d.stride) for d in message.layout.dim] == [("rows", 3, 12), ("cols", 4, 4)]
    assert np.array_equal(codec.decode(encode(message)), value)


@given(values(JOINTS, 6), stamps)
def test_the_message_of_joints_is_a_valid_one(value: np.ndarray, time_ns: int) -> None:
    message = VectorCodec(JOINTS).to_message(value, time_ns)
    assert encode(JointState.model_validate(message.model_dump())) == encode(message)
