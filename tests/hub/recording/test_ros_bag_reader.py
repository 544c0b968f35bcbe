"""ROS bags of every kind have the same topics and messages, and damaged ones are refused."""

from types import SimpleNamespace

import numpy as np
import pytest
import zstandard
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from hub.recording.ros_bag_reader import BagTopic, RosBag
from schemas.codec import message_type, validate_message
from schemas.crtk import StringStamped
from schemas.errors import RecordingError
from schemas.ros import EmptyMessage, Header, JointState, Time
from tests.hub.recording.ros_bags import EPOCH, SECOND, write, write1

HEADER = Header(stamp=Time.from_ns(EPOCH))
HOME = StringStamped(header=HEADER, string="home")
FIRST, LAST = (JointState(header=HEADER, position=np.array([0.1, x])) for x in (0.2, 0.3))
RECORDED = [
    (0.5, "/PSM1/state_command", HOME),
    (1.0, "/PSM1/move_jp", FIRST),
    (1.5, "/PSM1/hold", EmptyMessage()),
    (2.0, "/PSM1/move_jp", LAST),
]
"""Time (s) of recording, topic, message."""


def read(bag, topics, start):
    return [
        (topic, (time_ns - EPOCH) / SECOND, validate_message(message_type(bag.topics[topic].type), raw))
        for topic, time_ns, raw in bag.messages(topics, EPOCH + round(start * SECOND))
    ]


@pytest.mark.parametrize("form", ["directory", "compressed", "mcap", "db3 directory", "db3", "ros1"])
def test_bags_of_every_kind_are_read_alike(form, tmp_path):
    storage = StoragePlugin.SQLITE3 if "db3" in form else StoragePlugin.MCAP
    compression = CompressionMode.FILE if form == "compressed" else CompressionMode.NONE
    path = (
        write1(tmp_path / "one.bag", RECORDED)
        if form == "ros1"
        else write(tmp_path / "bag", RECORDED, storage, compression)
    )
    if form in ("mcap", "db3"):
        (path,) = path.glob(f"*.{form}")
    with RosBag(path) as bag:
        assert bag.start_ns == EPOCH + SECOND // 2
        assert bag.topics == {
            "/PSM1/state_command": BagTopic("crtk_msgs/msg/StringStamped", 1),
            "/PSM1/move_jp": BagTopic("sensor_msgs/msg/JointState", 2),
            "/PSM1/hold": BagTopic("std_msgs/msg/Empty", 1),
        }
        found = read(bag, bag.topics, 0.0)
        assert [(topic, t) for topic, t, _ in found] == [(topic, t) for t, topic, _ in RECORDED]
        assert found[0][2].string == "home"
        assert [m.position.tolist() for _, _, m in (found[1], found[3])] == [[0.1, 0.2], [0.1, 0.3]]
        assert [t for _, t, _ in read(bag, {"/PSM1/move_jp"}, 1.5)] == [2.0]
        assert read(bag, {"/nothing"}, 0.0) == []


def test_a_message_that_cannot_be_decoded_is_returned_as_its_error(tmp_path):
    recorded = [(t, "/PSM1/move_jp", said) for t, said in ((0.0, FIRST), (1.0, b"\0\1\0\0"), (2.0, LAST))]
    with RosBag(write(tmp_path / "bag", recorded)) as bag:
        found = [isinstance(raw, Exception) for _, _, raw in bag.messages(bag.topics, EPOCH)]
    assert found == [False, True, False]


def test_what_is_no_bag_is_refused(tmp_path):
    bag = write(tmp_path / "bag", RECORDED)
    (tmp_path / "half.mcap").write_bytes(next(bag.glob("*.mcap")).read_bytes()[:900])
    for nothing in (tmp_path / "nowhere", tmp_path, tmp_path / "half.mcap"):
        with pytest.raises(RecordingError, match=r"cannot read the bag .* a rosbag2 directory, an .mcap,"):
            RosBag(nothing)


def test_a_bag_that_does_not_fit_on_the_disk_is_not_unpacked(tmp_path, monkeypatch):
    bag = write(tmp_path / "bag", RECORDED, compression=CompressionMode.FILE)
    (packed,) = bag.glob("*.zstd")
    packed.write_bytes(zstandard.compress(bytes(2**24)))
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=2**24))
    unpacked = tmp_path / "temporary"
    unpacked.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(unpacked))
    with pytest.raises(RecordingError, match="is not unpacked: its compressed files need more than half"):
        RosBag(bag)
    assert list(unpacked.iterdir()) == []
