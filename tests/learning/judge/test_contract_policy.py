"""Policies behind a contract on trial: frames, recordings, faults, contracts that no environment can keep."""

from pathlib import Path

import numpy as np
import pytest

import trocar
from learning.judge.contract_policy import ContractPolicy
from learning.judge.episode import Trial, make_environment
from learning.judge.policies import PolicyAddress
from learning.judge.verdict import judge_trials
from schemas.errors import ScenarioError
from tests.learning.judge.reach_policy import GOAL

FILE = Path(__file__).with_name("reach_policy.py")
TRIAL = Trial("Reach", "nominal", 0)


@pytest.fixture
def judged(request):
    with ContractPolicy(f"python:{FILE}:Reach", request.param, 5) as policy:
        yield policy


@pytest.mark.parametrize("judged", [{}, {"rate": 10.0}], indirect=True)
def test_a_tip_goes_where_the_rows_say(judged):
    env = make_environment(TRIAL, judged.environment)
    observation, _ = env.reset(seed=0)
    judged.begin(env, 0)
    for _ in range(round(3.0 / env.step_s)):
        observation, *_ = env.step(judged.act(observation))
    np.testing.assert_allclose(observation["observation"][:3], GOAL, atol=1e-3)
    np.testing.assert_allclose(observation["achieved_goal"], GOAL, atol=1e-3)
    env.close()


@pytest.mark.long
def test_frames_are_those_of_the_contract():
    """In the base's frame the same rows lead to another place: 200 mm lower, and turned."""
    rows = [judge_trials(PolicyAddress(f"python:{FILE}:Reach", given), [TRIAL], None)[0]
            for given in ({"frame": "world"}, {"frame": "base"})]  # fmt: skip
    assert rows[0]["distance"] != pytest.approx(rows[1]["distance"], abs=1e-3)
    assert [row["error"] for row in rows] == [None, None]


@pytest.mark.long
def test_answers_are_actions_that_entered(tmp_path):
    (row,) = judge_trials(PolicyAddress(f"python:{FILE}:Reach"), [TRIAL], str(tmp_path))
    assert row["steps"] == 250  # 10 s in rows of 40 ms
    assert trocar.verify(tmp_path / TRIAL.name).same


def test_no_answer_is_a_failure_of_the_policy():
    (row,) = judge_trials(PolicyAddress(f"python:{FILE}:Lost"), [TRIAL], None)
    assert (row["failure"], row["steps"]) == ("policy failed", 5)
    assert "nan at row 0, 'psm1_sp.position.x': not finite" in row["error"]


@pytest.mark.parametrize(
    ("contract", "words"),
    [
        ({"frame": "camera"}, "the frames world and base"),
        ({"state": "joint"}, "an environment observes tips"),
        ({"action": "joint"}, "state frame 'base'"),
        ({"rate": 30.0}, "multiple of 20 ms"),
        ({"cameras": {"endoscope/left": {}}}, "environments have camera/left and camera/right"),
        ({"cameras": {"camera/left": {}, "camera/right": {"width": 64}}}, "have one size"),
        ({"horizon": 0}, "the contract is not valid"),
    ],
)
def test_a_contract_that_no_environment_can_keep(contract, words):
    with pytest.raises(ScenarioError, match=words):
        ContractPolicy(f"python:{FILE}:Reach", contract, 5)


def test_arms_of_another_exercise():
    policy = ContractPolicy(f"python:{FILE}:Reach", {"arms": ["PSM2"]}, 5)
    env = make_environment(TRIAL, policy.environment)
    with pytest.raises(ScenarioError, match="but the exercise has"):
        policy.begin(env, 0)
    env.close()
