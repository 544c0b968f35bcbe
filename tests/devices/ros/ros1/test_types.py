"""Types as ROS 1 has them: checksums of the real packages, and messages there and back."""

import pytest

from devices.ros.params import GatewayParams
from devices.ros.ros1.types import Wire, checksum, definition, ros1_name, service_checksum
from devices.ros.topics.dvrk_table import dvrk_table
from schemas.codec import encode, message_type
from schemas.errors import MessageError
from schemas.ros import Header, JointState, Time
from tests.devices.ros.crtk_table import WHOLE, sample

TOPICS = {row.type: row for row in dvrk_table(GatewayParams.model_validate(WHOLE)) if row.way != "serve"}
NOETIC = {
    "std_msgs/msg/Empty": "d41d8cd98f00b204e9800998ecf8427e",
    "std_msgs/msg/String": "992ce8a1687cec8c8bd883ec73ca41d1",
    "std_msgs/msg/Float64MultiArray": "4b7d974086d4060e7db4613a7e6c3ba4",
    "sensor_msgs/msg/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "sensor_msgs/msg/Joy": "5a9ea5f83505693b71e785041e67a8bb",
    "sensor_msgs/msg/Image": "060021388200f6f0f447d0fcd9c64743",
    "sensor_msgs/msg/CameraInfo": "c9a58c1b0b154e0e6da7578cb991d214",
    "geometry_msgs/msg/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
    "tf2_msgs/msg/TFMessage": "94810edda583a504dfda3829e70d7eec",
}
"""As `rosmsg md5` tells them."""


@pytest.mark.parametrize("type_", NOETIC)
def test_checksums_are_those_of_noetic(type_):
    assert checksum(type_) == NOETIC[type_]


def test_names_and_definitions():
    assert ros1_name("crtk_msgs/srv/QueryInverseKinematics") == "crtk_msgs/QueryInverseKinematics"
    assert definition("crtk_msgs/msg/StringStamped").splitlines() == [
        "std_msgs/Header header",
        "string string",
        "=" * 80,
        "MSG: std_msgs/Header",
        "uint32 seq",
        "time stamp",
        "string frame_id",
    ]
    # by genmsg, which test_ros1_gateway.py asks
    assert service_checksum("crtk_msgs/srv/QueryForwardKinematics") == "787c6da7a75e9886573c4af11f1a381f"


@pytest.mark.parametrize("type_", TOPICS)
def test_messages_there_and_back(type_):
    message, wire = encode(sample(TOPICS[type_])), Wire(type_)
    frame = wire.frame(message, 7)
    assert int.from_bytes(frame[:4], "little") == len(frame) - 4
    assert ("header" in message_type(type_).model_fields) == (
        frame[4:8] == b"\x07\x00\x00\x00" and len(frame) > 12
    )
    assert wire.cdr(frame[4:]) == message


def test_a_joint_state_byte_by_byte():
    message = JointState(
        header=Header(stamp=Time(sec=1, nanosec=2), frame_id="a"), name=["q"], position=[0.5]
    )
    numbers = (5).to_bytes(4, "little") + (1).to_bytes(4, "little") + (2).to_bytes(4, "little")
    one, none = (1).to_bytes(4, "little"), bytes(4)
    content = (
        numbers + one + b"a" + one + one + b"q" + one + b"\x00\x00\x00\x00\x00\x00\xe0\x3f" + none + none
    )
    assert Wire(JointState.ros_type).frame(encode(message), 5) == len(content).to_bytes(4, "little") + content


@pytest.mark.parametrize(
    "payload",
    [b"", b"\x00", b"\xff" * 60, bytes(range(256)) * 16],
    ids=["empty", "short", "lengths", "noise"],
)
@pytest.mark.parametrize(
    "type_",
    [
        "sensor_msgs/msg/JointState",
        "geometry_msgs/msg/PoseStamped",
        "std_msgs/msg/String",
        "crtk_msgs/msg/CartesianState",
    ],
)
def test_bytes_that_are_no_message_are_told(type_, payload):
    with pytest.raises(MessageError, match="no such message of ROS 1"):
        Wire(type_).cdr(payload)
