"""Demonstrations of an oracle as a data set: seeds, going on, dropped runs, other settings."""

from __future__ import annotations

import json
from pathlib import Path

import av
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from engines.mujoco.pictures import opengl
from learning.demonstrations.collection import Collection
from learning.demonstrations.command_line import app

pytestmark = pytest.mark.xdist_group("data sets")


def run(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


def lines(made: Path, name: str):
    return [json.loads(line) for line in (made / f"meta/{name}.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two demonstrations of Reach, the second by a second command; the first was taken up by half."""
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    place = tmp_path_factory.mktemp("demonstrations") / "reach"
    words = ("trocar/Reach-v0", "-o", place, "--size", "64x64", "--fps", 10, "--jobs", 1, "--task", "Reach.")
    done = run(*words, "--episodes", 1)
    assert done.exit_code == 0, done.output
    before = (place / "meta/info.json").read_text()
    # as if the command had been killed before the last line
    (place / "meta/episodes.jsonl").write_text("")
    (place / "parts/00000.json").unlink()
    done = run(*words, "--episodes", 2)
    assert done.exit_code == 0, done.output
    assert "2 episodes" in done.stdout
    assert "0 of 2 dropped" in done.stdout
    assert before != (place / "meta/info.json").read_text()
    return place


@pytest.mark.long
def test_the_data_set_has_all_episodes_once(made: Path) -> None:
    info = json.loads((made / "meta/info.json").read_text())
    episodes = lines(made, "episodes")
    assert sorted(one["seed"] for one in episodes) == [0, 1]
    assert [one["episode_index"] for one in episodes] == [0, 1]
    assert [one["episode_index"] for one in lines(made, "sources")] == [0, 1]
    assert len(lines(made, "episodes_stats")) == 2
    first = 0
    for one in episodes:
        number = one["episode_index"]
        rows = pq.read_table(made / f"data/chunk-000/episode_{number:06d}.parquet")
        assert rows["index"].to_pylist() == list(range(first, first + one["length"]))
        assert set(rows["episode_index"].to_pylist()) == {number}
        first += one["length"]
        name = f"observation.images.endoscope.left/episode_{number:06d}.mp4"
        with av.open(str(made / "videos/chunk-000" / name)) as film:
            assert sum(1 for _ in film.decode(video=0)) == one["length"]
    assert (info["total_episodes"], info["total_frames"]) == (2, first)
    assert "2 episodes" in (made / "meta/README.md").read_text()
    assert list((made / "parts").glob("*/")) == []


def test_the_state_hash_is_that_of_the_seed(made: Path) -> None:
    import gymnasium

    from trocar.environments import oracle

    env = gymnasium.make("trocar/Reach-v0")
    observation, info = env.reset(seed=1)
    policy = oracle(env.unwrapped)
    while not info["is_success"]:
        observation, *_, info = env.step(policy(observation))
    (source,) = [one for one in lines(made, "sources") if one["seed"] == 1]
    assert source["state_hash"] == env.unwrapped.state_hash
    env.close()


def test_other_settings_are_refused(made: Path) -> None:
    done = run("trocar/Reach-v0", "-o", made, "--size", "64x64", "--fps", 20, "--jobs", 1, "--task", "Reach.")
    assert "holds other demonstrations" in str(done.exception)


@pytest.mark.long
def test_a_run_that_does_not_finish_its_task_is_dropped(tmp_path: Path) -> None:
    words = ("pick-and-place", "-o", tmp_path / "none", "--episodes", 1, "--set", "duration=200 ms")
    done = run(*words, "--jobs", 1)
    assert done.exit_code == 1
    assert "dropped: seed 0: the task was not done" in done.stderr
    assert lines(tmp_path / "none", "dropped") == [{"seed": 0, "failure": "the task was not done"}]


def test_a_scenario_that_cannot_tell_a_success_is_refused(tmp_path: Path) -> None:
    done = run("table", "-o", tmp_path / "none")
    assert isinstance(done.exception, Exception)
    assert "no measure `done`" in str(done.exception) or "seed" in str(done.exception)
    assert "no environment 'trocar/Nothing-v0'" in str(run("trocar/Nothing-v0", "-o", tmp_path).exception)


def test_a_failure_is_noted_once(tmp_path: Path) -> None:
    collection = Collection(tmp_path, {})
    assert collection.take_up({"seed": 3, "failure": "the goal was not reached"})
    assert collection.dropped == {3: "the goal was not reached"}
    assert collection.take_up({"seed": 3, "failure": "the goal was not reached"}) == ""
