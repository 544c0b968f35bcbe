from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer
from pydantic import ValidationError

from devices.samples import stamp_message
from devices.scripted.device import ScriptedDevice, ScriptedParams
from hub.participant import VectorSample
from schemas.codec import encode, ros2msg_definition
from schemas.message import Message
from schemas.ros import Header, Joy, Point, Pose, PoseStamped, Time

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND


def _write(file: Path, messages: list[tuple[str, int, Message]]) -> None:
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for topic, time_ns, message in messages:
            if topic not in channels:
                schema = writer.register_schema(
                    message.ros_type, "ros2msg", ros2msg_definition(message.ros_type).encode()
                )
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time_ns, encode(message), time_ns)
        writer.finish()


def _pose(time_ns: int, x: float) -> PoseStamped:
    return PoseStamped(
        header=Header(stamp=Time.from_ns(time_ns), frame_id="stylus_base"), pose=Pose(position=Point(x=x))
    )


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second of poses at 100 Hz and two button events, stamped by a wall clock."""
    file = tmp_path_factory.mktemp("hand") / "hand.mcap"
    poses = [
        ("/pose", EPOCH + i * SECOND // 100, _pose(EPOCH + i * SECOND // 100, i / 100)) for i in range(101)
    ]
    joys = [
        ("/buttons", EPOCH + ms * SECOND // 1000, Joy(buttons=np.array([ms], np.int32))) for ms in (205, 705)
    ]
    _write(file, sorted([*poses, *joys], key=lambda m: m[1]))
    return file


def _device(file: Path, **params: Any) -> ScriptedDevice:
    return ScriptedDevice(
        "stylus",
        ScriptedParams.model_validate({"samples": file.name, **params}, context={"directory": file.parent}),
    )


def test_ports_are_known_before_it_is_opened(hand: Path) -> None:
    buttons, pose = _device(hand, max_age="100 ms", time="wall").ports
    assert (pose.name, pose.type, pose.variability, pose.frame) == (
        "pose",
        PoseStamped.ros_type,
        "signal",
        "stylus_base",
    )
    assert (pose.max_age_ns, pose.clock, pose.causality) == (10**8, "wall", "output")
    assert (buttons.name, buttons.variability, buttons.max_age_ns) == ("buttons", "event", 0)


def test_samples_come_when_they_are_due(hand: Path) -> None:
    with _device(hand) as device:
        device.open(hand.parent)
        (first,) = device.read(0)
        assert isinstance(first.message, PoseStamped)
        assert (first.port, first.message.header.stamp.ns, first.message.header.frame_id) == (
            "pose",
            0,
            "stylus_base",
        )
        assert device.read(SECOND // 100 - 1) == []
        assert [s.port for s in device.read(SECOND // 100)] == ["pose"]
        rest = device.read(2 * SECOND)
        assert [s.port for s in rest].count("buttons") == 2
        assert len(rest) == 101
        assert device.read(3 * SECOND) == []


def test_stamps_are_in_the_clock_of_the_port(hand: Path) -> None:
    device = _device(hand, rate=2.0)
    device.open(hand.parent)
    samples = device.read(SECOND // 2)
    stamps = [s.message.header.stamp.ns for s in samples if isinstance(s.message, PoseStamped | Joy)]
    assert len(samples) == 103
    assert stamps == sorted(stamps)
    assert stamps[-1] == SECOND // 2


@pytest.mark.parametrize("frame", ["stylus_base", "another_base"])
def test_samples_have_the_bytes_of_what_was_recorded_with_a_new_stamp(tmp_path: Path, frame: str) -> None:
    """As numbers where all messages of a topic are laid out alike, else as messages."""
    poses = [_pose(EPOCH + i * SECOND // 100, i / 100) for i in range(10)]
    poses[5] = PoseStamped(header=Header(stamp=poses[5].header.stamp, frame_id=frame), pose=poses[5].pose)
    _write(
        tmp_path / "hand.mcap", [("/pose", EPOCH + i * SECOND // 100, pose) for i, pose in enumerate(poses)]
    )
    device = _device(tmp_path / "hand.mcap")
    device.open(tmp_path)
    samples = device.read(SECOND)
    assert all(isinstance(sample, VectorSample) for sample in samples) == (frame == "stylus_base")
    assert [sample.encode() for sample in samples] == [
        encode(stamp_message(pose, i * SECOND // 100)) for i, pose in enumerate(poses)
    ]


def test_a_loop_goes_on_with_the_same_spacing(hand: Path) -> None:
    device = _device(hand, loop=True)
    device.open(hand.parent)
    samples = [s.message for s in device.read(3 * SECOND) if isinstance(s.message, PoseStamped)]
    stamps = np.array([m.header.stamp.ns for m in samples])
    assert len(stamps) > 290
    assert np.diff(stamps).min() > 0
    assert np.diff(stamps).max() <= SECOND // 100
    assert samples[101].pose.position.x == 0.0


@given(st.lists(st.integers(0, 3 * SECOND), max_size=20))
def test_how_often_it_is_asked_changes_nothing(hand: Path, times: list[int]) -> None:
    at_once, in_parts = _device(hand), _device(hand)
    at_once.open(hand.parent)
    in_parts.open(hand.parent)
    parts = [sample for t in [*sorted(times), 3 * SECOND] for sample in in_parts.read(t)]
    whole = at_once.read(3 * SECOND)
    assert [(s.port, encode(s.message)) for s in parts] == [(s.port, encode(s.message)) for s in whole]


def test_opened_again_it_starts_again(hand: Path) -> None:
    device = _device(hand)
    for _ in range(2):
        device.open(hand.parent)
        assert len(device.read(SECOND)) == 103
        device.close()
        assert device.read(9 * SECOND) == []


def test_what_cannot_be_played(tmp_path: Path) -> None:
    _write(tmp_path / "empty.mcap", [])
    (tmp_path / "text.mcap").write_text("not a recording at all")
    _write(tmp_path / "cut.mcap", [("/pose", 0, _pose(0, 0))])
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "cut.mcap").read_bytes()[:-20])
    with (tmp_path / "foreign.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channel = writer.register_channel(
            "/cloud", "cdr", writer.register_schema("sensor_msgs/msg/PointCloud2", "ros2msg", b"")
        )
        writer.add_message(channel, 0, b"", 0)
        writer.finish()
    problems = {
        "missing.mcap": "no recording at",
        "empty.mcap": "holds no messages",
        "text.mcap": "is not an MCAP file",
        "cut.mcap": "was cut short",
        "foreign.mcap": "unknown message type 'sensor_msgs/msg/PointCloud2'",
    }
    for name, problem in problems.items():
        with pytest.raises(ValidationError, match=problem):
            _device(tmp_path / name)


@pytest.mark.parametrize(
    "params", [{"rate": 0}, {"rate": float("inf")}, {"time": "later"}, {"max_age": "0 s"}, {"speed": 2}]
)
def test_parameters_out_of_range(hand: Path, params: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        _device(hand, **params)


def test_without_a_context_no_file_is_opened(hand: Path) -> None:
    """Parameters of a stranger's recording may be validated anywhere."""
    with pytest.raises(ValidationError, match="is not opened: validate with"):
        ScriptedParams.model_validate({"samples": str(hand)})
