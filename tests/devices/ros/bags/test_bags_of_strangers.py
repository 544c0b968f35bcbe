"""Bags and recordings of strangers are only data: nothing that they name is run, or read elsewhere."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from mcap.writer import Writer

from devices.ros.bags.export import export
from hub.planning import registry
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.recording.ros_bag_reader import RosBag
from schemas.codec import encode
from schemas.crtk import StringStamped
from schemas.errors import RecordingError, TrustError

MODULE = """
from pathlib import Path
(Path(__file__).parent / "ran").touch()
from devices.ros.zenoh.gateway import ZenohGateway as Gateway
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "foreign_gateway.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    registry.load.cache_clear()
    sys.modules.pop("foreign_gateway", None)


def stranger(place: Path, hours: Sequence[int] = (), **gateways: dict[str, object]) -> Recording:
    """Return a recording of a session with these gateways, of which each has a kind and parameters.

    At each of `hours` a message entered by `ros`.
    """
    scenario = {"name": "guest", "step": 1_000_000, "participants": gateways}
    participants = {
        name: {
            "name": name,
            "kind": spec["kind"],
            "role": "device",
            "host": "hub",
            "period": 1,
            "ports": [],
        }
        for name, spec in gateways.items()
    }
    plan = {"step_ns": 1_000_000, "order": [], "participants": participants}
    plan |= {"connections": [], "from_devices": [], "to_devices": [], "bonds": []}
    attachments = {
        "scenario.json": json.dumps(scenario).encode(),
        "plan.json": json.dumps(plan).encode(),
        "origin.json": json.dumps({"directory": str(place)}).encode(),
    }
    with Recorder(place / "recording", attachments=attachments) as recorder:
        if hours:
            entered = recorder.add_channel("/device/ros/out/PSM1/state_command", StringStamped.ros_type)
            message = StringStamped(string="enable")
            for hour in hours:
                recorder.write(entered, hour * 3_600_000_000_000, encode(message))
    return Recording(place / "recording")


FOREIGN = {"kind": "foreign_gateway:Gateway"}
INSTALLED = {"kind": "ros2-zenoh"}


@pytest.mark.parametrize("name", [None, "ros"])
def test_a_gateway_that_is_not_installed(place: Path, name: str | None) -> None:
    recording = stranger(place, ros=FOREIGN)
    with pytest.raises(TrustError, match=r"the class 'foreign_gateway:Gateway'.*\(participant 'ros'\)"):
        export(recording, place / "bag", name)
    assert not (place / "ran").exists()
    assert not (place / "bag").exists()
    export(recording, place / "bag", name, trust=True)
    assert (place / "ran").exists()


@pytest.mark.parametrize("name", [None, "ros"])
def test_beside_one_that_is_installed_it_is_not_loaded(place: Path, name: str | None) -> None:
    export(stranger(place, ros=INSTALLED, other=FOREIGN), place / "bag", name)
    assert not (place / "ran").exists()


def test_a_description_with_other_contents_is_not_read(place: Path) -> None:
    (place / "secret.urdf").write_text("<robot/>")
    recording = stranger(place, ros={**INSTALLED, "robot_description": "secret.urdf"})
    with pytest.raises(TrustError, match=r"the file '.*/secret\.urdf', which is missing or has other"):
        export(recording, place / "bag")
    assert not (place / "bag").exists()
    export(recording, place / "bag", trust=True)


@pytest.mark.long
def test_a_time_that_would_fill_the_disk(place: Path) -> None:
    """A gateway's transforms are written in each of its periods up to the time of the last message."""
    recording = stranger(place, ros={**INSTALLED, "arms": {"PSM1": {"instrument": "400006"}}}, hours=[1, 3])
    with pytest.raises(RecordingError, match="nothing from 3600 s to 10800 s; at most 3600 s are allowed"):
        export(recording, place / "bag")


CODE = "__import__('pathlib').Path('{}').touch()"


@pytest.mark.parametrize(
    ("name", "language", "text"),
    [
        ("std_msgs/msg/A\n{code}\n#", "ros2msg", "string data\n"),
        ("std_msgs/msg/A:\n    {code}\n    x=(", "ros2msg", "string data\n"),
        ('std_msgs/msg/A"""\n{code}\n"""', "ros2msg", "string data\n"),
        ("std_msgs/msg/A", "ros2msg", "int32 X={code}\nint32 y\n"),
        ("std_msgs/msg/A", "ros2msg", "string X='{code}'\nstring Y=\"\n{code}\n"),
        ("std_msgs/msg/A", "ros2msg", "uint8[{code}] data\n"),
        (
            "std_msgs/msg/A",
            "ros2msg",
            "std_msgs/B b\n" + 80 * "=" + "\nMSG: std_msgs/B:\n    {code}\nint32 x\n",
        ),
        (
            "std_msgs/msg/A",
            "ros2idl",
            "module std_msgs {{ module msg {{ struct A {{ string data; @verbatim(language='x', text="
            '"{code}") long y; const string X = "{code}"; }}; }}; }};',
        ),
    ],
)
def test_definitions_in_a_bag_are_not_run(tmp_path: Path, name: str, language: str, text: str) -> None:
    """`rosbags` makes Python code from them, and runs it."""
    code = CODE.format(tmp_path / "ran")
    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(name.format(code=code), language, text.format(code=code).encode())
        channel = writer.register_channel("/x", "cdr", schema, {})
        writer.add_message(channel, 0, b"\0\1\0\0\1\0\0\0\0", 0)
        writer.finish()
    try:
        with RosBag(tmp_path / "bag.mcap") as bag:
            list(bag.messages(list(bag.topics), 0))
    except RecordingError:
        pass
    assert not (tmp_path / "ran").exists()


def test_a_bag_reads_no_file_beside_its_directory(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "secret.db3").write_text("secret")
    (tmp_path / "bag" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {version: 5, storage_identifier: sqlite3, relative_file_paths:"
        " [../secret.db3], duration: {nanoseconds: 1}, starting_time: {nanoseconds_since_epoch: 0},"
        " message_count: 0, topics_with_message_count: []}\n"
    )
    with pytest.raises(RecordingError, match=r"files are missing: .*bag/secret\.db3"):
        RosBag(tmp_path / "bag")
