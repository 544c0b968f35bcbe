"""An Open-H data set of a session: its rules, and its poses beside those of the session's own controller."""

from __future__ import annotations

import json
from pathlib import Path
from typing import cast

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import trocar
from engines.mujoco.pictures import opengl
from learning.datasets.command_line import app
from learning.datasets.instructions import instructions
from learning.datasets.open_h_meta import modality
from schemas.ros import StringMessage

pytestmark = pytest.mark.xdist_group("data sets")
META = ("info.json", "episodes.jsonl", "episodes_stats.jsonl", "tasks.jsonl", "README.md", "modality.json")
SECTIONS = ("synchronization", "dataset description", "collection procedure", "robot", "sensor")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of two arms and an endoscope with a motion controller."""
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    place = tmp_path_factory.mktemp("open-h") / "recorded"
    trocar.run(
        "pick-and-place",
        set={"duration": "2 s", "participants.endoscope.period": "1 s"},
        record=place,
        pace="fast",
        one_host=True,
    )
    return place


@pytest.fixture(scope="module")
def made(recording: Path) -> Path:
    """A data set of two episodes."""
    place = recording.parent / "set"
    words = (recording, recording, "-o", place, "--format", "open-h", "--size", "96x64", "--task", "Sort.")
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    return place


def table(made: Path, episode: int):
    return pq.read_table(made / f"data/chunk-000/episode_{episode:06d}.parquet")


@pytest.mark.long
def test_it_has_what_open_h_asks_for(made: Path) -> None:
    """The rules of Open-H's validator, in our own words."""
    assert {path.name for path in (made / "meta").iterdir()} >= set(META)
    readme = (made / "meta/README.md").read_text().lower()
    assert [section for section in SECTIONS if section not in readme] == []
    info = json.loads((made / "meta/info.json").read_text())
    assert (info["codebase_version"], info["robot_type"], info["fps"]) == ("v2.1", "dvrk", 30)
    assert {"train", "val", "test"} <= set(info["splits"])
    assert info["tolerance_s"] > 0.0
    features = info["features"]
    assert {"action", "observation.state", "instruction.text"} <= set(features)
    for eye in ("left", "right"):
        feature = features[f"observation.images.endoscope.{eye}"]
        assert (feature["dtype"], feature["shape"]) == ("video", [64, 96, 3])
    episodes = [json.loads(line) for line in (made / "meta/episodes.jsonl").read_text().splitlines()]
    assert [(one["episode_index"], one["tasks"]) for one in episodes] == [(0, ["Sort."]), (1, ["Sort."])]
    assert sum(one["length"] for one in episodes) == info["total_frames"]
    statistics = [json.loads(line) for line in (made / "meta/episodes_stats.jsonl").read_text().splitlines()]
    assert statistics[1]["stats"]["action"]["count"] == [episodes[1]["length"]]


@pytest.mark.long
def test_each_feature_is_a_column_of_each_episode_or_a_video(made: Path) -> None:
    info = json.loads((made / "meta/info.json").read_text())
    for episode in (0, 1):
        rows = table(made, episode)
        videos = {key for key, feature in info["features"].items() if feature["dtype"] == "video"}
        assert set(rows.column_names) == set(info["features"]) - videos
        for key, feature in info["features"].items():
            if key in videos:
                file = made / info["video_path"].format(episode_chunk=0, video_key=key, episode_index=episode)
                with av.open(str(file)) as container:
                    assert sum(1 for _ in container.decode(video=0)) == rows.num_rows
            else:
                size = np.array(rows[key].to_pylist()).reshape(rows.num_rows, -1).shape[1]
                assert [size] == feature["shape"], key


def test_poses_are_those_of_the_controller_in_the_frame_of_the_endoscope(made: Path, recording: Path) -> None:
    source, rows = trocar.Recording(recording), table(made, 0)
    state, action = (np.array(rows[name].to_pylist()) for name in ("observation.state", "action"))
    names = json.loads((made / "meta/info.json").read_text())["features"]["action"]["names"]
    assert (names[0], names[7], names[8]) == ("psm1_sp.position.x", "psm1_jaw_sp", "psm2_sp.position.x")
    measured, setpoint = source["motion.PSM1/measured_cp"], source["motion.PSM1/setpoint_cp"]
    assert measured.frame == "ECM"
    for k in (10, 30, 50):
        for numbers, series, time in ((state, measured, k / 30), (action, setpoint, (k + 1) / 30)):
            pose = series.values[np.searchsorted(series.time, time + 1e-9) - 1]
            np.testing.assert_allclose(numbers[k, :3], pose[:3], atol=2e-6)
            assert abs(numbers[k, 3:7] @ pose[3:]) == pytest.approx(1.0, abs=1e-6)
    jaw = source["motion.PSM1/jaw/measured_js"]["position"]
    assert state[-1, 7] == pytest.approx(jaw[-1, 0], abs=0.05)
    # quaternions of neighbouring frames are on the same side
    assert (np.sum(state[1:, 3:7] * state[:-1, 3:7], axis=1) > 0.9).all()


def test_groups_of_gr00t_are_those_of_the_numbers(made: Path) -> None:
    modality = json.loads((made / "meta/modality.json").read_text())
    assert modality["action"] == {
        "psm1_pose": {"start": 0, "end": 7},
        "psm1_gripper": {"start": 7, "end": 8},
        "psm2_pose": {"start": 8, "end": 15},
        "psm2_gripper": {"start": 15, "end": 16},
    }
    assert modality["video"]["endoscope_left"]["original_key"] == "observation.images.endoscope.left"


def test_truths_are_beside_the_pictures(made: Path, recording: Path) -> None:
    rows, source = table(made, 0).to_pylist(), trocar.Recording(recording)
    assert rows[0]["observation.meta.tool.psm1"] == "CADIERE_FORCEPS_400049"
    assert rows[0]["instruction.text"] == "Sort."
    assert len(rows[0]["observation.meta.force_torque.psm2"]) == 6
    piece = np.array(rows[0]["observation.meta.object.piece1"])
    distance = np.linalg.norm(
        piece[:3] - np.array(rows[0]["observation.meta.object.piece3"])[:3]
    )  # the same in every frame
    world = [source[f"robot.{name}/pose"].values[0, :3] for name in ("piece1", "piece3")]
    assert distance == pytest.approx(np.linalg.norm(world[0] - world[1]), abs=1e-5)


class _Told:
    """A recording of a routine that gives two instructions."""

    ports = {"task.events": "trocar_msgs/msg/TaskEvent", "routine.instruction": "std_msgs/msg/String"}  # noqa: RUF012

    def __getitem__(self, port: str) -> _Told:
        assert port == "routine.instruction"
        return self

    def messages(self) -> list[tuple[float, StringMessage]]:
        return [(0.5, StringMessage(data="grasp")), (1.0, StringMessage(data="clip"))]


def test_each_frame_has_the_instruction_of_its_sub_task(recording: Path) -> None:
    times_ns = np.array([0, 500_000_000, 999_999_999, 1_000_000_000, 3_000_000_000], np.int64)
    told = instructions(cast("trocar.Recording", _Told()), times_ns, "operate")
    assert told.tolist() == ["grasp", "grasp", "grasp", "clip", "clip"]
    without = instructions(trocar.Recording(recording), times_ns, "sort")
    assert without.tolist() == ["sort"] * 5


def test_a_third_arm_follows_the_two_of_open_h() -> None:
    names = [f"{arm}_pose.position.x" for arm in ("psm1", "psm2", "psm3")]
    groups = modality({"features": {"observation.state": {"names": names}}})["action"]
    assert groups["psm3_pose"] == {"start": 16, "end": 23}
    assert groups["psm3_gripper"] == {"start": 23, "end": 24}


def test_ports_of_ones_own_are_not_for_open_h(recording: Path, tmp_path: Path) -> None:
    words = [str(recording), "-o", str(tmp_path / "set"), "--format", "open-h", "--state", "robot.qpos"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert "names its own numbers" in done.output
