"""A recording as a session of dvrk_data: its documents, its pictures, and all that reads it back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from typer.testing import CliRunner

import trocar
from engines.mujoco.pictures import opengl
from hub.recording.dvrk_session import session_bag
from hub.recording.ros_bag_reader import RosBag
from hub.recording.time_order import messages_by_time
from learning.dvrk_sessions.command_line import app
from learning.dvrk_sessions.documents import Frame, Tag, index, session_tags, video_sidecar
from learning.relive.command_line import app as relive
from schemas.errors import RecordingError
from tasks.recorded.ros_bag import score_ros_bag
from tasks.recorded.session import score_session

pytestmark = pytest.mark.xdist_group("dvrk sessions")  # its session is recorded once, in one process

FRAME = {
    "frame_index": int,
    "gst": dict.fromkeys(
        ("pts_ns", "dts_ns", "duration_ns", "running_time_ns", "stream_time_ns", "clock_time_ns"), int
    ),
    "cpu": {
        "realtime": dict.fromkeys(
            (
                "mono_source_ns",
                "left_source_ns",
                "right_source_ns",
                "stereo_output_ns",
                "overlay_output_ns",
                "recorder_reception_ns",
            ),
            int,
        ),
        "monotonic": {"recorder_reception_ns": int},
    },
}
SIDECAR = {
    "type": str,
    "video_file": str,
    "stream_name": str,
    "start_cpu_realtime_ns": int,
    "end_cpu_realtime_ns": int,
    "timestamp_statistics": {"from_unixfd": int, "at_reception": int},
    "frames_recorded": int,
    "frames_dropped": int,
    "side_by_side": str,
    "estimated_latency_ms": float,
    "clock_domains": dict.fromkeys(("cpu_realtime", "cpu_monotonic", "gst_clock"), dict),
    "config_files": list,
    "frames": [FRAME],
}
INSTANT = {"cpu_ts": int, "generated_at": str}
TAGS = {
    "type": str,
    "generated_at": str,
    "stages": [{"name": str, "start": INSTANT, "end": INSTANT}],
    "tags": dict,
}
INDEX = {
    "type": str,
    "rosbags": str,
    "streams": [{"name": str, "videos": [{"file": str, "duration": float, "frames": int}]}],
}


def fits(value: Any, shape: Any) -> bool:
    """Whether a document has exactly the fields of a shape; numbers of frames may be null."""
    if isinstance(shape, dict):
        return value.keys() == shape.keys() and all(fits(value[key], shape[key]) for key in shape)
    if isinstance(shape, list):
        return all(fits(one, shape[0]) for one in value)
    if shape is int:
        return value is None or (isinstance(value, int) and value >= 0)
    return isinstance(value, shape)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One second of the pick-and-place scene, with pictures from a host of their own."""
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    place = tmp_path_factory.mktemp("recordings") / "pick"
    trocar.run("pick-and-place", set={"duration": "1 s"}, record=place)
    return place


@pytest.fixture(scope="module")
def session(recording: Path) -> Path:
    done = export(recording)
    assert done.exit_code == 0, done.output
    return recording.with_name("pick-dvrk-data")


def export(*words: object):
    return CliRunner().invoke(app, ["export", *(str(word) for word in words)])


def document(file: Path) -> Any:
    return json.loads(file.read_text())


@pytest.mark.long
def test_documents_have_the_fields_of_dvrk_data(session: Path) -> None:
    shown = document(session / "index.json")
    assert fits(shown, INDEX)
    assert shown["type"] == "dvrk_data:index@1.0.0"
    assert [stream["name"] for stream in shown["streams"]] == ["left", "right"]
    assert shown["streams"][0]["videos"] == [{"duration": 0.96, "file": "left.mp4", "frames": 25}]
    for eye in ("left", "right"):
        sidecar = document(session / f"{eye}.json")
        assert fits(sidecar, SIDECAR)
        assert sidecar["type"] == "dvrk_data:video_sidecar@1.0.0"
        assert [frame["frame_index"] for frame in sidecar["frames"]] == list(range(25))
        assert sidecar["frames_recorded"] == sidecar["timestamp_statistics"]["from_unixfd"] == 25
    tags = document(session / "session_tags.json")
    assert fits(tags, TAGS)
    assert tags["type"] == "dvrk_data:session_tags@1.0.0"
    assert tags["stages"][0]["name"] == "pick-and-place"


@pytest.mark.long
def test_times_of_pictures_are_exact(recording: Path, session: Path) -> None:
    original = trocar.Recording(recording)
    for eye in ("left", "right"):
        frames = document(session / f"{eye}.json")["frames"]
        taken = [
            message.header.stamp.ns
            for _, message in original[f"endoscope.{eye}/image_raw/compressed"].messages()
        ]
        assert [frame["cpu"]["realtime"][f"{eye}_source_ns"] for frame in frames] == [
            original.started_ns() + time_ns for time_ns in taken
        ]
        with av.open(str(session / f"{eye}.mp4")) as video:
            assert video.streams.video[0].codec_context.name == "h264"
            shown = [float(frame.time) for frame in video.decode(video=0)]
        assert shown == pytest.approx([frame["gst"]["pts_ns"] / 1e9 for frame in frames], abs=1e-5)


def test_joints_are_exact(recording: Path, session: Path) -> None:
    original = trocar.Recording(recording)
    with RosBag(session) as bag:
        for name in ("PSM1/measured_js", "PSM2/setpoint_js", "PSM1/jaw/measured_js"):
            recorded = original[f"motion.{name}"]
            read = list(bag.messages([f"/{name}"], bag.start_ns))
            assert [time_ns - original.started_ns() for _, time_ns, _ in read] == np.round(
                recorded.time * 1e9
            ).astype(int).tolist()
            assert np.array_equal(
                np.array([message.position for _, _, message in read]), recorded["position"]
            )
        assert not any("image" in topic for topic in bag.topics)


def test_an_export_is_the_same_again(recording: Path, session: Path, tmp_path: Path) -> None:
    assert export(recording, "--format", "dvrk-data", "-o", tmp_path / "again").exit_code == 0
    first, second = (
        {file.relative_to(place): file.read_bytes() for file in place.rglob("*") if file.is_file()}
        for place in (session, tmp_path / "again")
    )
    assert first == second


@pytest.mark.long
def test_a_session_is_scored_and_relived(recording: Path, session: Path, tmp_path: Path) -> None:
    again, original = (
        {metric.name: metric.value for metric in card.metrics}
        for card in (
            score_ros_bag(session, ()).card,
            score_session(trocar.Recording(recording), ())["task"].card,
        )
    )
    assert again["PSM1/angular_path"] == pytest.approx(original["PSM1/angular_path"], rel=0.05)
    done = CliRunner().invoke(relive, [str(session), "--record", str(tmp_path / "again")])
    assert done.exit_code == 0, done.output
    assert "101 frames at 100 Hz, joint set-points: PSM1, PSM2" in done.stdout
    commanded = trocar.Recording(recording)["motion.PSM1/setpoint_js"]["position"]
    followed = trocar.Recording(tmp_path / "again")["robot.PSM1/setpoint_js"]["position"]
    for joints in commanded[1:]:
        assert np.abs(followed - joints).max(axis=1).min() == 0.0, "each set-point is commanded to the bit"


@pytest.mark.long
def test_pictures_that_were_not_recorded_are_drawn(recording: Path, tmp_path: Path) -> None:
    place = tmp_path / "unseen"
    trocar.run(
        "pick-and-place", set={"duration": "200 ms", "participants.endoscope.images": "none"}, record=place
    )
    done = export(place, "--fps", "20", "--size", "96x64", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["pictures"] == "drawn"
    frames = document(tmp_path / "unseen-dvrk-data/left.json")["frames"]
    assert [frame["gst"]["pts_ns"] for frame in frames] == [0, 50_000_000, 100_000_000, 150_000_000]
    del recording


def test_messages_by_time(recording: Path) -> None:
    """Hosts are recorded in blocks: a picture of 40 ms stands before the joints of 30 ms."""
    original = trocar.Recording(recording)
    written = [message.time_ns for message in original.messages()]
    by_time = [message.time_ns for message in messages_by_time(original)]
    assert written != sorted(written)
    assert by_time == sorted(written)


def test_a_strange_index_is_refused(tmp_path: Path) -> None:
    assert session_bag(tmp_path) == tmp_path
    for content, problem in (
        ("[]", "is of type 'None'"),
        ("{", "cannot read"),
        ('{"type": "dvrk_data:index@2.0.0"}', "is of type 'dvrk_data:index@2.0.0'"),
        ('{"type": "dvrk_data:index@1.0.0", "rosbags": "../../etc"}', "names no ROS bag beside it"),
        ('{"type": "dvrk_data:index@1.0.0"}', "names no ROS bag beside it"),
    ):
        (tmp_path / "index.json").write_text(content)
        with pytest.raises(RecordingError, match=problem):
            session_bag(tmp_path)


def test_nothing_is_left_of_a_failed_export(recording: Path, session: Path, tmp_path: Path) -> None:
    assert export(recording).exit_code == 2, "it exists already"
    done = export(recording, "-o", tmp_path / "out", "--gateway", "ros")
    assert "no gateway 'ros'" in str(done.exception)
    assert not any(tmp_path.iterdir())
    del session


def test_gaps_and_events_in_documents() -> None:
    frames = [Frame(0, 1), Frame(40, 41), Frame(1_000_000_040, 1_000_000_041)]
    assert index({"left": frames})["streams"][0]["videos"][0]["duration"] == 40e-9, "a pause is not counted"
    sidecar = video_sidecar("right", frames, 1_000)
    assert sidecar["end_cpu_realtime_ns"] == 1_000_001_041
    assert sidecar["frames"][1]["cpu"]["realtime"]["right_source_ns"] == 1_040
    assert sidecar["frames"][1]["cpu"]["realtime"]["left_source_ns"] is None
    tags = session_tags("cut", 2_000_000_000, [Tag("dropped", 500_000_000), Tag("dropped", 1)], 10**18)
    assert [one["cpu_ts"] - 10**18 for one in tags["tags"]["dropped"]] == [500_000_000, 1]
    assert tags["stages"][0]["end"] == {
        "cpu_ts": 10**18 + 2 * 10**9,
        "generated_at": "2001-09-09T01:46:42.000",
    }
