"""An episode relived: residuals, other readings of its numbers, and what is no episode."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import trocar
from learning.relive.arms import placed_arms
from learning.relive.command_line import app
from robots.transform import matrix_to_pose

FRAMES = 20
FIELDS = [f"position.{axis}" for axis in "xyz"] + [f"orientation.{axis}" for axis in "xyzw"]


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    """Set-points of both arms of pick-and-place in the endoscope's frame: PSM1 moves, PSM2 stays."""
    loaded = trocar.load_scenario("pick-and-place")
    arms = placed_arms(loaded.params["robot"], ("PSM1", "PSM2"), "ECM")
    rows = np.zeros((FRAMES, 16))
    for i, arm in enumerate(arms.values()):
        joints = np.repeat(np.array(arm.mounted.start)[None], FRAMES, axis=0)
        if i == 0:
            joints[:, 0] += np.linspace(0.0, 0.05, FRAMES)
            joints[:, 4] += np.linspace(0.0, 0.3, FRAMES)
        poses = arm.base @ arm.mounted.chain.forward(joints)
        rows[:, 8 * i : 8 * i + 7] = [matrix_to_pose(pose) for pose in poses]
        rows[:, 8 * i + 7] = 0.4
    return rows


def write(place: Path, rows: np.ndarray) -> Path:
    """Write rows as a data set of one episode in format v2.1."""
    info = {
        "codebase_version": "v2.1",
        "fps": 30,
        "total_episodes": 1,
        "chunks_size": 1000,
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    }
    (place / "meta").mkdir(parents=True)
    (place / "data/chunk-000").mkdir(parents=True)
    (place / "meta/info.json").write_text(json.dumps(info))
    table = pa.table({"action": rows.tolist(), "episode_index": [0] * len(rows)})
    pq.write_table(table, place / "data/chunk-000/episode_000000.parquet")
    return place


def run(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_arms_follow_the_set_points(rows: np.ndarray, tmp_path: Path) -> None:
    done = run(write(tmp_path / "set", rows), "--record", tmp_path / "again")
    assert done.exit_code == 0, done.output
    assert "20 frames at 30 Hz, poses in ECM: PSM1" in done.stdout
    assert "as stated: quaternion xyzw, m: 100 % of the frames in reach" in done.stdout
    tip_mm = float(done.stdout.partition("PSM1: tip ")[2].split()[0])
    assert 0.0 < tip_mm < 5.0, "it follows, with the lag of its servos"
    recording = trocar.Recording(tmp_path / "again")
    reached = recording["robot.PSM1/measured_js"]["position"][-1, 0]
    assert reached - recording["robot.PSM1/measured_js"]["position"][0, 0] == pytest.approx(0.05, abs=0.01)
    assert trocar.verify(tmp_path / "again").same


def test_another_order_and_another_unit_are_found_out(rows: np.ndarray, tmp_path: Path) -> None:
    other = rows.copy()
    for at in (0, 8):
        other[:, at : at + 3] *= 1e3
        other[:, at + 3 : at + 7] = rows[:, [at + 6, at + 3, at + 4, at + 5]]
    place = write(tmp_path / "set", other)
    done = run(place)
    assert done.exit_code == 1
    assert (
        "in doubt: with --order wxyz --unit mm 100 % of the frames are in reach, as stated 0 %" in done.stdout
    )
    assert "no frame is in reach: PSM1, frame 0: pose cannot be reached" in str(done.exception)
    # what the wrong reading would mean at the tip
    assert "degrees away (a finger of 10 mm ends" in done.stdout
    done = run(place, "--order", "wxyz", "--unit", "mm")
    assert done.exit_code == 0, done.output
    assert "as stated: quaternion wxyz, mm: 100 % of the frames in reach" in done.stdout


def test_a_table_of_suturebot_is_read_by_its_names(rows: np.ndarray, tmp_path: Path) -> None:
    names = [
        name
        for arm in ("psm1", "psm2")
        for name in (*(f"{arm}_sp.{field}" for field in FIELDS), f"{arm}_jaw_sp")
    ]
    lines = [",".join(["timestamp", *names])]
    lines += [",".join(map(str, [i, *row])) for i, row in enumerate(rows.tolist())]
    (tmp_path / "ee_csv.csv").write_text("\n".join(lines))
    done = run(tmp_path)
    assert done.exit_code == 0, done.output
    assert "PSM1: tip " in done.stdout


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda rows: rows[:, :14], "has 14 numbers in a row"),
        (lambda rows: rows * np.where(np.arange(16) % 8 == 3, 9.0, 1.0), "the quaternion has norm"),
        (lambda rows: rows[:1].repeat(5, axis=0), "no arm moves"),
    ],
)
def test_what_is_no_episode(rows: np.ndarray, tmp_path: Path, change, says: str) -> None:
    done = run(write(tmp_path / "set", change(rows)))
    assert done.exit_code == 1
    assert says in str(done.exception)


def test_what_is_no_data_set(tmp_path: Path) -> None:
    assert "is no data set that can be read" in str(run(tmp_path).exception)
    place = write(tmp_path / "set", np.zeros((2, 16)))
    assert "has no episode 7; there are 1" in str(run(place, "--episode", 7).exception)
