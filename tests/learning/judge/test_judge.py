"""Verdicts: rows, recordings that re-simulate without the policy, resumption, comparison, the page."""

import json
import re
from importlib import import_module

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import trocar
from engines.mujoco.pictures import opengl
from hub.command_line.app import app
from learning.judge.difficulties import DIFFICULTIES, difficulties_of
from learning.judge.episode import Trial, make_environment
from learning.judge.policies import PolicyAddress
from learning.judge.suites import SUITES, exercises_of
from learning.judge.verdict import Verdict, judge_trials
from schemas.errors import ScenarioError

OWN = "tests.learning.judge.own_policies"


def judge(*arguments):
    done = CliRunner().invoke(app, ["judge", *map(str, arguments)], catch_exceptions=False)
    return done.exit_code, done.output


@pytest.fixture(scope="module")
def expert(tmp_path_factory):
    """A verdict about the expert: one exercise, two difficulties, two seeds, by two processes."""
    place = tmp_path_factory.mktemp("judge") / "expert"
    code, output = judge(
        "--policy", "expert", "--suite", "NeedlePick", "--difficulty", "nominal,joint-errors",
        "--seeds", 2, "--jobs", 2, "-o", place,
    )  # fmt: skip
    assert code == 0, output
    return place, output


def test_the_expert_masters_the_nominal_world_alone(expert):
    place, output = expert
    assert "NeedlePick, nominal: 2 of 2 (0.34 to 1.00)" in output
    assert "NeedlePick, joint-errors: 0 of 2 (0.00 to 0.66); never grasped 2" in output
    rows = pq.read_table(place / "trials.parquet").to_pylist()
    assert [(row["difficulty"], row["seed"], row["success"]) for row in rows] == [
        ("nominal", 0, True),
        ("nominal", 1, True),
        ("joint-errors", 0, False),
        ("joint-errors", 1, False),
    ]
    assert 0.0 < rows[0]["first.grasped"] < rows[0]["first.lifted"] <= rows[0]["time_s"] < 5.0
    assert rows[0]["metrics.PSM1/path_length (m)"] > 0.03


@pytest.mark.parametrize("trial", ["NeedlePick-nominal-00001", "NeedlePick-joint-errors-00000"])
def test_a_verdict_can_be_appealed(expert, trial):
    place, _ = expert
    assert trocar.verify(place / "trials" / trial).same


def test_a_trial_judged_again_has_the_same_bits(expert, tmp_path):
    place, _ = expert
    file = place / "trials" / "NeedlePick-nominal-00001.json"
    verdict = Verdict(PolicyAddress("expert"), ("NeedlePick",), ("nominal", "joint-errors"), 2, place)
    (again,) = judge_trials(PolicyAddress("expert"), [verdict.trials[1]], None)
    there = json.loads(file.read_text())
    assert again["state_hash"] == there["state_hash"]
    assert again["metrics"] == there["metrics"]


def test_an_interrupted_verdict_goes_on(expert):
    place, output = expert
    file = place / "trials" / "NeedlePick-nominal-00000.json"
    before = file.read_text()
    file.unlink()
    code, again = judge(
        "--policy", "expert", "--suite", "NeedlePick", "--difficulty", "nominal,joint-errors",
        "--seeds", 2, "--jobs", 1, "-o", place,
    )  # fmt: skip
    assert (code, again.splitlines()[-3:]) == (0, output.splitlines()[-3:])
    assert file.read_text() == before


def test_a_directory_is_of_one_verdict(expert, tmp_path):
    place, _ = expert
    with pytest.raises(ScenarioError, match=r"another verdict \(other policy, difficulties, seeds\)"):
        Verdict(PolicyAddress("random"), ("NeedlePick",), ("nominal",), 1, place).open()
    (tmp_path / "letter.txt").write_text("mine")
    with pytest.raises(ScenarioError, match="something else than a verdict"):
        Verdict(PolicyAddress("random"), ("NeedlePick",), ("nominal",), 1, tmp_path).open()


def test_the_page_leads_to_each_trial(expert):
    page = (expert[0] / "index.html").read_text()
    assert "<h1>expert: 50 %" in page
    assert "trocar view trials/NeedlePick-joint-errors-00000 --at 10.02" in page
    assert len(re.findall(r"<code>[0-9a-f]{32}</code>", page)) == 4
    assert "http" not in page.replace('http-equiv="Content-Security-Policy"', "")


def test_a_policy_that_fails_does_not_end_the_suite():
    trials = [Trial("Reach", "nominal", seed) for seed in (0, 1)]
    rows = judge_trials(PolicyAddress(f"{OWN}:Failing"), trials, None)
    assert [row["failure"] for row in rows] == ["policy failed", "goal not reached"]
    assert "expected (5,) finite numbers" in rows[0]["error"]
    assert rows[0]["steps"] == 2


def test_a_policy_that_is_held_is_entered_and_left():
    judge_trials(PolicyAddress(f"{OWN}:Held"), [Trial("Reach", "nominal", seed) for seed in (0, 1)], None)
    assert import_module(OWN).Held.said == ["entered", "left"]


@pytest.mark.long
def test_two_policies_on_the_same_seeds(expert, tmp_path):
    other = tmp_path / "random"
    code, _ = judge("--policy", "random", "--suite", "NeedlePick", "--seeds", 2, "--jobs", 1, "-o", other)
    assert code == 0
    code, output = judge("--compare", other, expert[0])
    assert code == 0
    assert output.startswith("NeedlePick, nominal: 0 and 2 of 2, difference +1.00")
    assert "no difference is shown" in output  # two pairs say little
    with pytest.raises(ScenarioError, match="holds no verdict with a finished trial"):
        judge("--compare", tmp_path, other)


def test_seeds_move_the_camera_alone():
    if not (found := opengl.find()).name:
        pytest.skip(found.detail)
    pictures = []
    for seed in (1, 2, 1):
        env = make_environment(Trial("Reach", "camera-offset", seed), {"images": True})
        observation, _ = env.reset(seed=5)
        pictures.append(observation)
        env.close()
    np.testing.assert_array_equal(pictures[0]["left"], pictures[2]["left"])
    assert (pictures[0]["left"] != pictures[1]["left"]).any()
    np.testing.assert_array_equal(pictures[0]["observation"], pictures[1]["observation"])


def test_names():
    assert exercises_of("suturing,Reach,NeedlePick") == (*SUITES["suturing"], "Reach")
    assert difficulties_of("all") == tuple(DIFFICULTIES)
    with pytest.raises(ScenarioError, match=r"no suite and no exercise 'sutring'\. Did you mean 'suturing'"):
        exercises_of("sutring")
    with pytest.raises(ScenarioError, match="no difficulty 'latency'"):
        difficulties_of("latency")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("exprt", "no policy 'exprt'. Did you mean 'expert'"),
        ("no_such_module:Policy", "cannot be made: No module named"),
        (f"{OWN}:NoPolicy", "has no begin and no act"),
    ],
)
def test_a_policy_that_is_none(name, words, tmp_path):
    with pytest.raises(ScenarioError, match=words):
        judge("--policy", name, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()
