"""A data set of real sessions: its layout, its numbers and videos against what was recorded."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
from pathlib import Path
from typing import Any

import av
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import trocar
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.recorded_scene import RecordedScene
from learning.datasets.command_line import app
from learning.datasets.video import Video
from learning.datasets.writer import Writer
from learning.own_directory import claim_directory
from robots.dvrk import arm_bodies, ecm
from robots.dvrk.own_dynamics import BodyInertia, JointLosses, OwnDynamics
from schemas.errors import TrocarError
from trocar import Recording

pytestmark = pytest.mark.xdist_group("data sets")  # its sessions are recorded once, in one process

SCENARIO = """
name: seen
description: PSM1 waits while the endoscope looks on.
step: 5 ms
duration: 320 ms
participants:
  robot: &scene
    kind: mujoco
    arms:
      PSM1: {instrument: LARGE_NEEDLE_DRIVER_400006, position: [0 mm, 0 mm, 120 mm], jaw: 30 deg}
      ECM: {position: [45 mm, 0 mm, 200 mm], start: [0, 0, 100 mm, 0]}
    objects: {ring: {kind: ring, position: [0 mm, 0 mm, 10 mm]}}
  camera: {<<: *scene, kind: endoscope, period: 40 ms, width: 96, height: 64}
connections:
  - robot.qpos -> camera.qpos
"""
EYES = ("left", "right")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with recordings: `seen` has pictures, `unseen` has none, and no ECM."""
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    place = tmp_path_factory.mktemp("recordings")
    (place / "seen.yaml").write_text(SCENARIO)
    unseen = SCENARIO[: SCENARIO.index("  camera:")].replace("name: seen", "name: unseen")
    (place / "unseen.yaml").write_text(unseen.replace("      ECM", "#"))
    for name in ("seen", "unseen"):
        trocar.run(str(place / f"{name}.yaml"), record=place / name, one_host=True)
    return place


@pytest.fixture(scope="module")
def made(recordings: Path) -> Path:
    """The data set of `seen`, twice: two episodes."""
    done = run(recordings / "seen", recordings / "seen", "-o", recordings / "set", "--task", "Wait  a\nwhile")
    assert done.exit_code == 0, done.output
    assert "2 episodes, 16 frames" in done.stdout
    assert "2 x 'Wait a while'" in done.stdout
    return recordings / "set"


def run(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


def frames(file: Path) -> list[np.ndarray]:
    with av.open(str(file)) as container:
        decoded = list(container.decode(video=0))
        assert [frame.time for frame in decoded] == pytest.approx([k / 25 for k in range(len(decoded))])
        return [frame.to_ndarray(format="rgb24") for frame in decoded]


def info(directory: Path):
    return json.loads((directory / "meta/info.json").read_text())


def rows(directory: Path):
    return pq.read_table(directory / "data/chunk-000/file-000.parquet")


def test_it_says_what_is_in_it(made: Path) -> None:
    about = info(made)
    counts = {name: about[name] for name in ("codebase_version", "fps", "total_episodes", "total_frames")}
    assert counts == {"codebase_version": "v3.0", "fps": 25, "total_episodes": 2, "total_frames": 16}
    assert about["splits"] == {"train": "0:2"}
    names = about["features"]["observation.state"]["names"]
    assert names[:5] == ["ECM.yaw", "ECM.pitch", "ECM.insertion", "ECM.roll", "PSM1.yaw"]
    assert names[-1] == "PSM1.jaw"
    assert about["features"]["observation.images.left"]["shape"] == [64, 96, 3]
    tasks = pd.read_parquet(made / "meta/tasks.parquet")
    assert tasks.iloc[0].name == "Wait a while"
    assert tasks["task_index"].tolist() == [0]


def test_each_scenario_has_a_task_of_its_own_unless_one_is_given(recordings: Path, tmp_path: Path) -> None:
    words = (
        recordings / "seen",
        recordings / "unseen",
        "-o",
        tmp_path / "set",
        "--state",
        "robot.PSM1/measured_js",
    )
    done = run(
        *words, "--action", "robot.PSM1/setpoint_js", "--task", "unseen=Look away", "--task", "other=?"
    )
    assert done.exit_code == 0, done.output
    tasks = pd.read_parquet(tmp_path / "set/meta/tasks.parquet")
    assert list(tasks.index) == ["PSM1 waits while the endoscope looks on.", "Look away"]
    assert "--task other=...: no recording is of that scenario" in done.stderr
    twice = run(recordings / "seen", "-o", tmp_path / "two", "--task", "a", "--task", "b")
    assert twice.exit_code == 2


def test_each_row_has_what_was_recorded_then(recordings: Path, made: Path) -> None:
    table, recording = rows(made), Recording(recordings / "seen")
    joints = recording["robot.PSM1/measured_js"]
    setpoints = recording["robot.PSM1/setpoint_js"]
    state, action = (np.array(table[name].to_pylist()) for name in ("observation.state", "action"))
    for k in range(8):
        then = np.searchsorted(joints.time, 0.04 * k + 1e-9) - 1
        np.testing.assert_allclose(state[k, 4:10], joints["position"][then], rtol=1e-6)
        following = np.searchsorted(setpoints.time, 0.04 * (k + 1) + 1e-9) - 1
        np.testing.assert_allclose(action[k, 4:10], setpoints["position"][following], rtol=1e-6)
    assert (state[:8] == state[8:]).all()
    # a float32 of k / fps is what the loader compares with the times of the video
    assert table["timestamp"].to_pylist() == [np.float32(k / 25) for k in range(8)] * 2
    assert table["index"].to_pylist() == list(range(16))
    assert table["frame_index"].to_pylist() == [*range(8), *range(8)]
    assert table["episode_index"].to_pylist() == [0] * 8 + [1] * 8
    assert str(table.schema.field("observation.state").type) == "fixed_size_list<element: float>[11]"


def test_episodes_follow_one_another_in_the_files(made: Path) -> None:
    episodes = pq.read_table(made / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(one["dataset_from_index"], one["dataset_to_index"], one["length"]) for one in episodes] == [
        (0, 8, 8),
        (8, 16, 8),
    ]
    for eye in EYES:
        key = f"videos/observation.images.{eye}"
        assert [one[f"{key}/from_timestamp"] for one in episodes] == pytest.approx([0.0, 0.32])
        assert [one[f"{key}/to_timestamp"] for one in episodes] == pytest.approx([0.32, 0.64])
        assert len(frames(made / f"videos/observation.images.{eye}/chunk-000/file-000.mp4")) == 16
    assert np.array(episodes[0]["stats/observation.images.left/mean"]).shape == (3, 1, 1)


def test_recorded_pictures_are_taken_and_others_drawn_as_the_camera_draws(
    recordings: Path, made: Path
) -> None:
    sources = json.loads((made / "meta/recordings.json").read_text())
    assert [one["pictures"] for one in sources] == ["recorded", "recorded"]
    recording = Recording(recordings / "seen")
    taken = [message for _, message in recording["camera.left/image_raw"].messages()]
    assert [message.header.stamp.ns for message in taken] == [k * 40_000_000 for k in range(len(taken))]
    kept = frames(made / "videos/observation.images.left/chunk-000/file-000.mp4")
    # the robot steps before the camera, which so sees the end of the robot's own step of 5 ms
    seen_ns = [message.header.stamp.ns + 5_000_000 for message in taken]
    drawn = RecordedScene(recording).stereo(seen_ns, (96, 64))
    for message, (left, right), frame in zip(taken, drawn, kept[:8], strict=False):
        assert (message.data.reshape(64, 96, 3) == left).all(), "the camera's own picture, bit for bit"
        assert (left != right).any()
        assert np.abs(frame.astype(int) - left).mean() < 12, "the codec loses a little"


def test_a_session_without_camera_and_without_endoscope_is_drawn(recordings: Path, tmp_path: Path) -> None:
    done = run(recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64", "--fps", "20")
    assert done.exit_code == 0, done.output
    about = info(tmp_path / "set")
    assert (about["total_frames"], about["features"]["observation.images.right"]["shape"]) == (6, [64, 64, 3])
    (source,) = json.loads((tmp_path / "set/meta/recordings.json").read_text())
    assert source["pictures"] == "drawn"
    statistics = json.loads((tmp_path / "set/meta/stats.json").read_text())
    assert statistics["observation.images.left"]["max"][0][0][0] > 0.2, "something is seen"


def test_ports_of_ones_own(recordings: Path, tmp_path: Path) -> None:
    ports = ("--state", "robot.PSM1/measured_cp.position", "--action", "robot.PSM1/setpoint_js.position.yaw")
    done = run(recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64", "--fps", "10", *ports)
    assert done.exit_code == 0, done.output
    features = info(tmp_path / "set")["features"]
    assert features["observation.state"]["names"] == [f"robot.PSM1/measured_cp.position.{x}" for x in "xyz"]
    assert features["action"]["shape"] == [1]
    assert str(rows(tmp_path / "set").schema.field("action").type) == "float"


def test_what_cannot_be_used_is_left_out_and_the_rest_is_whole(recordings: Path, tmp_path: Path) -> None:
    shutil.copytree(recordings / "seen", tmp_path / "cut")
    (file,) = (tmp_path / "cut").glob("*.mcap")
    file.write_bytes(file.read_bytes()[: int(0.7 * file.stat().st_size)])
    (tmp_path / "none").mkdir()
    paths = (tmp_path / "none", tmp_path / "cut", recordings / "unseen", recordings / "seen")
    done = run(*paths, "-o", tmp_path / "set")
    assert done.exit_code == 1
    assert "left out: " in done.stderr
    assert "holds 0 .mcap files" in done.stderr
    assert "cut' was cut short: its first 0." in done.stderr
    assert "has another state than the first recording of the data set (ECM." in done.stderr
    assert "2 episodes" in done.stdout
    assert "2 left out" in done.stdout
    assert info(tmp_path / "set")["total_frames"] == rows(tmp_path / "set").num_rows


@pytest.mark.long
def test_a_scene_of_a_changed_file_is_drawn_with_trust_alone(recordings: Path, tmp_path: Path) -> None:
    bodies = {
        name: BodyInertia(mass=body.mass, centre=body.centre, tensor=body.tensor)
        for name, body in arm_bodies.ecm().items()
    }
    losses = JointLosses(armature=0.0, stiffness=1e-3, offset=0.0, viscous=0.3)
    joints = dict.fromkeys(ecm.JOINT_NAMES, losses)
    own = OwnDynamics(instrument="endoscope", bodies=bodies, joints=joints, discs=[])
    (tmp_path / "ecm.yaml").write_text(own.text(), "utf-8")
    scenario = SCENARIO[: SCENARIO.index("  camera:")].replace("ECM: {", "ECM: {dynamics: ecm.yaml, ")
    (tmp_path / "own.yaml").write_text(scenario)
    trocar.run(tmp_path / "own.yaml", record=tmp_path / "own", one_host=True)
    assert run(tmp_path / "own", "-o", tmp_path / "same").exit_code == 0
    (tmp_path / "ecm.yaml").write_text(f"# changed\n{own.text()}", "utf-8")
    done = run(tmp_path / "own", recordings / "seen", "-o", tmp_path / "without")
    assert done.exit_code == 1
    assert "1 episode, 8 frames, 1 left out" in done.stdout
    assert "ecm.yaml', which is missing or has other contents than those recorded" in done.stderr
    assert "allow it with --trust" in done.stderr
    done = run(tmp_path / "own", recordings / "seen", "-o", tmp_path / "set", "--trust")
    assert done.exit_code == 0, done.stderr
    assert "2 episodes" in done.stdout


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--size", "640"), "is not a size"),
        (("--size", "65x64"), "is not a size"),
        (("--state", "robot.PSM1/measured_j"), "Did you mean 'robot.PSM1/measured_js'?"),
        (("--action", "robot.PSM1/measured_js.torque"), "has no field 'torque'"),
    ],
)
def test_bad_words(recordings: Path, tmp_path: Path, words: tuple[str, ...], says: str) -> None:
    done = run(recordings / "unseen", "-o", tmp_path / "set", *words)
    assert done.exit_code != 0
    assert says in " ".join(done.output.replace("│", " ").split())
    assert not (tmp_path / "set").exists()


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="no scheduling policies here")
def test_the_encoder_does_not_raise_the_priority_of_its_caller(tmp_path: Path) -> None:
    """SVT-AV1 does, as root: to real time, above everything on the machine."""
    before = os.sched_getscheduler(0)
    video = Video(tmp_path / "black.mp4", (64, 64), 30)
    for _ in range(3):
        video.add(np.zeros((64, 64, 3), np.uint8))
        assert os.sched_getscheduler(0) == before
    video.close()
    assert os.sched_getscheduler(0) == before


def test_a_directory_that_is_in_use_is_left_alone(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "letter.txt").touch()
    done = run(recordings / "unseen", "-o", tmp_path)
    assert done.exit_code == 2
    assert "exists already" in " ".join(done.stderr.replace("│", " ").split())


def test_each_frame_has_its_action(recordings: Path, tmp_path: Path) -> None:
    done = run(recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64")
    assert done.exit_code == 0, done.output
    setpoints = Recording(recordings / "unseen")["robot.PSM1/setpoint_js"]
    actions = rows(tmp_path / "set")["action"].to_pylist()
    assert len(actions) == 8, "320 ms at 25 frames a second"
    np.testing.assert_allclose(actions[-1][:6], setpoints["position"][-1], rtol=1e-6)


def test_of_two_into_one_directory_the_second_is_refused(recordings: Path, tmp_path: Path) -> None:
    with claim_directory(tmp_path / "set.part", "data set"):
        done = run(recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64")
    assert (done.exit_code, str(done.exception)[:22]) == (1, "another process uses '")
    assert not (tmp_path / "set").exists()


def test_what_a_killed_one_has_left_is_replaced(recordings: Path, tmp_path: Path) -> None:
    with claim_directory(tmp_path / "set.part", "data set"):
        (tmp_path / "set.part/meta").mkdir()
        (tmp_path / "set.part/left").touch()
    done = run(recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64")
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in (tmp_path / "set").iterdir()) == ["data", "meta", "videos"]
    assert not (tmp_path / "set.part").exists()


def test_one_that_is_terminated_leaves_the_episodes_so_far(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add = Writer.add

    def add_and_terminate(writer: Writer, *words: Any) -> None:
        add(writer, *words)
        if writer.episodes == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(Writer, "add", add_and_terminate)
    done = run(*[recordings / "unseen"] * 4, "-o", tmp_path / "set", "--size", "64x64")
    assert done.exit_code != 0
    assert info(tmp_path / "set")["total_episodes"] == 2
    assert rows(tmp_path / "set").num_rows == 16
    assert not (tmp_path / "set.part").exists()


def test_a_full_disk_leaves_nothing_but_a_sentence(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pq.ParquetWriter, "write_table", fail)
    done = run(recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64")
    assert isinstance(done.exception, TrocarError)
    assert "set' cannot be written, and is not made: [Errno 28] No space left" in str(done.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_recording_that_cannot_be_opened_is_left_out(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    (tmp_path / "gone/gone_0.mcap").symlink_to(tmp_path / "nowhere")
    done = run(tmp_path / "gone", recordings / "unseen", "-o", tmp_path / "set", "--size", "64x64")
    assert done.exit_code == 1
    assert "left out: '" in done.stderr
    assert info(tmp_path / "set")["total_episodes"] == 1


def test_looks_that_are_asked_for_are_drawn_though_pictures_are_recorded(
    recordings: Path, tmp_path: Path
) -> None:
    done = run(recordings / "seen", "-o", tmp_path / "set", "--looks", "plain")
    assert done.exit_code == 0, done.output
    (source,) = json.loads((tmp_path / "set/meta/recordings.json").read_text())
    assert source["pictures"] == "drawn"
