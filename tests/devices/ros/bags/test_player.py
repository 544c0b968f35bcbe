"""What a bag of any kind brings into a session, and what of it is refused."""

import logging
import subprocess

import numpy as np
import pytest
from pydantic import ValidationError

from devices.ros.bags.params import BagParams
from devices.ros.bags.player import BagPlayer
from hub.participant import Device
from hub.testing import check_device
from schemas.codec import encode
from schemas.crtk import StringStamped
from schemas.errors import RecordingError
from schemas.ros import (
    BoolMessage,
    EmptyMessage,
    Header,
    JointState,
    Joy,
    Pose,
    PoseStamped,
    Quaternion,
    StringMessage,
    Time,
)
from tests.devices.ros.rospy_peer import environment, needs_rospy, rospy_python
from tests.hub.recording.ros_bags import EPOCH, SECOND, write, write1

ARMS = {"arms": {"PSM1": {"instrument": "400006"}}}


def header(t):
    return Header(stamp=Time.from_ns(EPOCH + round(t * SECOND)))


def command(t, word="home"):
    return StringStamped(header=header(t), string=word)


def joints(t, *positions):
    return JointState(header=header(t), position=np.array(positions, float))


SAID = [
    (0.0, "/rosout", StringMessage(data="a node has started")),
    (0.5, "/PSM1/state_command", command(0.4999)),
    (1.0, "/PSM1/move_jp", joints(1.0, 0.1, 0.2, 0.12, 0.0, 0.0, 0.0)),
    (1.5, "/PSM1/jaw/servo_jp", joints(1.5, 0.3)),
    (1.5, "/PSM1/hold", EmptyMessage()),
    (2.0, "/console/teleop/enable", BoolMessage(data=True)),
    (2.5, "/PSM1/measured_js", joints(2.5, *[0.0] * 6)),
]
"""Time (s) of recording, topic, message."""


def player(bag, **params):
    return BagPlayer(
        "bag", BagParams.model_validate({"bag": bag, **ARMS, **params}, context={"directory": bag.parent})
    )


def played(bag, until=10.0, **params):
    with player(bag, **params) as device:
        device.open(bag.parent)
        return device.read(round(until * SECOND))


def stamp(sample):
    return sample.message.header.stamp.ns / SECOND


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write(tmp_path_factory.mktemp("said") / "bag", SAID)


@pytest.mark.parametrize("form", ["ros2", "ros1"])
def test_a_bag_of_either_ros_is_played(form, bag, tmp_path):
    samples = played(bag if form == "ros2" else write1(tmp_path / "said.bag", SAID))
    assert [sample.port for sample in samples] == [
        "PSM1/state_command",
        "PSM1/move_jp",
        "PSM1/jaw/servo_jp",
        "PSM1/hold",
        "console/teleop/enable",
    ]
    assert samples[0].message.string == "home"
    assert samples[1].message.position.tolist() == [0.1, 0.2, 0.12, 0.0, 0.0, 0.0]
    assert [stamp(sample) for sample in samples[:3]] == [0.5, 1.0, 1.5]


ROSBAG = """
import sys
import rosbag, rospy
from sensor_msgs.msg import JointState

with rosbag.Bag(sys.argv[1], "w", compression="bz2") as bag:
    message = JointState(position=[0.1] * 6)
    message.header.stamp = rospy.Time(1700000000)
    bag.write("/PSM1/servo_jp", message, rospy.Time(1700000000))
    bag.write("/PSM1/servo_jp", message, rospy.Time(1700000001, 500000000))
"""


@pytest.mark.ros
@needs_rospy
def test_a_bag_that_ros_1_itself_has_written(tmp_path):
    python, path = rospy_python()
    ran = subprocess.run(
        [python, "-c", ROSBAG, tmp_path / "one.bag"],
        env=environment(path),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if "No module named 'rosbag'" in ran.stderr:
        pytest.skip("needs rosbag: apt install python3-rosbag")
    assert ran.returncode == 0, ran.stderr
    assert [(sample.port, stamp(sample)) for sample in played(tmp_path / "one.bag")] == [
        ("PSM1/servo_jp", 0.0),
        ("PSM1/servo_jp", 1.5),
    ]


def test_ports_are_those_of_a_gateway_that_the_bag_has_something_for(bag):
    ports = {port.name: port for port in player(bag).ports}
    assert ports.keys() == {
        "PSM1/state_command",
        "PSM1/move_jp",
        "PSM1/jaw/servo_jp",
        "PSM1/hold",
        "console/teleop/enable",
    }
    assert {(port.causality, port.variability, port.clock) for port in ports.values()} == {
        ("output", "event", "simulated")
    }
    assert ports["PSM1/move_jp"].names == ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")


def test_samples_come_when_they_are_due_and_the_session_can_run_again(bag):
    with player(bag) as device:
        for _ in range(2):
            device.open(bag.parent)
            assert device.read(SECOND // 2 - 1) == []
            assert [sample.port for sample in device.read(SECOND // 2)] == ["PSM1/state_command"]
            assert len(device.read(5 * SECOND)) == 4
            assert device.read(6 * SECOND) == []


def test_a_part_of_it_slower(bag):
    samples = played(bag, start="750 ms", rate=0.5)
    assert samples[0].port == "PSM1/move_jp"
    assert [stamp(sample) for sample in samples[:2]] == [0.5, 1.5]


def test_it_keeps_the_contract_of_a_device(bag):
    def make() -> Device:
        return player(bag)

    check_device(make)


def test_topics_may_have_other_names(tmp_path):
    """dVRK 1 called them so."""
    old = "/dvrk/PSM1/set_position_goal_joint"
    bag = write(
        tmp_path / "old", [(0.0, old, joints(0.0, *[0.1] * 6)), (0.1, "/sim/PSM1/hold", EmptyMessage())]
    )
    assert [sample.port for sample in played(bag, rename={old: "/PSM1/move_jp"})] == ["PSM1/move_jp"]
    assert [sample.port for sample in played(bag, namespace="sim")] == ["PSM1/hold"]
    with pytest.raises(ValidationError, match=r"no topic '/dvrk/PSM1/set_position_goal'. Did you mean"):
        player(bag, rename={"/dvrk/PSM1/set_position_goal": "/PSM1/move_jp"})


def test_states_of_a_real_system_are_signals(tmp_path):
    pose = PoseStamped(header=header(0.0), pose=Pose())
    invalid = PoseStamped(header=Header(stamp=Time.from_ns(0)), pose=Pose())
    pedal = Joy(header=header(0.1), buttons=np.array([1], np.int32))
    said = [
        (0.0, "/MTMR/measured_cp", pose),
        (0.05, "/MTMR/measured_cp", invalid),
        (0.1, "/footpedals/clutch", pedal),
    ]
    bag = write(tmp_path / "real", said)
    device = player(bag, listen=["MTMR", "footpedals"], rate=0.5)
    measured, clutch = device.ports
    # ten periods of 10 ms, played at half the speed
    assert (measured.variability, measured.max_age_ns) == ("signal", SECOND // 5)
    assert (clutch.name, clutch.variability) == ("footpedals/clutch", "event")
    assert [sample.port for sample in played(bag, listen=["MTMR", "footpedals"])] == [
        "MTMR/measured_cp",
        "footpedals/clutch",
    ]


def test_what_a_gateway_refuses_is_refused(tmp_path, caplog):
    """The good one between the bad ones is played, and every refusal is logged."""
    said = [
        (0.0, "/PSM1/servo_jp", joints(0.0, 0.1, 0.2)),
        (0.1, "/PSM1/servo_jp", joints(0.1, *[0.1] * 6)),
        (0.2, "/PSM1/servo_cp", PoseStamped(header=header(0.2), pose=Pose(orientation=Quaternion(w=0.5)))),
    ]
    no_number = encode(said[1][2]).replace(np.array(0.1).tobytes(), np.array(np.nan).tobytes())
    bag = write(
        tmp_path / "bad",
        [*said, (1.0, "/PSM1/servo_jp", no_number), (1.0, "/PSM1/servo_jp", b"\x00\x01\x00\x00nonsense")],
    )
    with caplog.at_level(logging.WARNING):
        samples = played(bag)
    assert [stamp(sample) for sample in samples] == [0.1]
    told = [record.getMessage() for record in caplog.records]
    for reason in (
        "2 values in position, expected 6 (at 0 s)",
        "has norm 0.5",
        "every number must be finite",
        "no such message",
    ):
        assert any(reason in line for line in told), told


def test_an_old_command_delivered_by_a_new_connection_is_refused(tmp_path, caplog):
    """A recorder that joins late gets the last state command of a program, of an hour ago; one that is
    brought twice counts once.
    """
    again = command(1.0, "enable")
    said = [
        (0.0, "/PSM1/state_command", command(-3600.0)),
        (1.0, "/PSM1/state_command", again),
        (1.3, "/PSM1/state_command", again),
    ]
    said.append((2.0, "/PSM1/state_command", StringStamped(string="disable")))  # no stamp: always new
    bag = write(tmp_path / "latched", said)
    with caplog.at_level(logging.WARNING):
        samples = played(bag)
    assert [(sample.message.string, stamp(sample)) for sample in samples] == [
        ("enable", 1.0),
        ("disable", 2.0),
    ]
    told = "\n".join(record.getMessage() for record in caplog.records)
    assert "published 3600.0 s before it was recorded" in told
    assert "accepted before, with the same stamp" in told


def test_ignored_topics_are_logged(bag, caplog):
    with caplog.at_level(logging.INFO):
        played(bag)
    (line,) = [record.getMessage() for record in caplog.records]
    assert line.endswith(
        "that no port here takes are ignored: /PSM1/measured_js (sensor_msgs/msg/JointState, 1), /rosout"
        " (std_msgs/msg/String, 1)"
    )


def test_a_bag_with_nothing_to_play_is_refused_before_the_session(bag, tmp_path):
    with pytest.raises(
        ValidationError,
        match=(
            r"nothing that could be played here. Its topics: .*/PSM1/hold \(std_msgs/msg/Empty,"
            r" 1\).*/SUJ/PSM2/servo_jp"
        ),
    ):
        player(bag, arms={"PSM2": {}}, namespace="elsewhere")
    other = write(tmp_path / "other", [(0.0, "/PSM1/hold", BoolMessage(data=True))])
    with pytest.raises(ValidationError, match="nothing that could be played"):
        player(other)
    for nothing in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(ValidationError, match="cannot read the bag"):
            player(nothing)
    (tmp_path / "half.mcap").write_bytes(next(bag.glob("*.mcap")).read_bytes()[:900])
    with pytest.raises(ValidationError, match="cannot read the bag"):
        player(tmp_path / "half.mcap")


def test_a_bag_that_goes_while_it_is_played(bag, tmp_path):
    copy = write(tmp_path / "copy", SAID)
    device = player(copy)
    for file in copy.iterdir():
        file.unlink()
    with pytest.raises(RecordingError, match="cannot read the bag"):
        device.open(tmp_path)
