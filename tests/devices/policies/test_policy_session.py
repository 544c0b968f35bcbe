"""A policy in a session: it leads the arm, and the recording is simulated again and forked without it."""

import shutil
from pathlib import Path

import pytest

import trocar
from hub.planning.scenario_file import installed_scenarios
from schemas.errors import ParticipantError, TrustError

pytest.importorskip("ruckig")
pytest.importorskip("mujoco")

HERE = Path(__file__).parent


@pytest.fixture
def scenario(tmp_path):
    """The scenario with a policy beside it."""
    file = tmp_path / "scenario.yaml"
    shutil.copy(installed_scenarios()["policy"], file)
    (tmp_path / "data" / "policies").mkdir(parents=True)
    own = installed_scenarios()["policy"].parent / "data" / "policies" / "pick.py"
    shutil.copy(own, tmp_path / "data" / "policies" / "pick.py")
    shutil.copy(HERE / "policies.py", tmp_path)
    return file


def run(scenario, record=None, **values):
    return trocar.run(str(scenario), set={"duration": "0.3 s", **values}, record=record, one_host=True)


@pytest.mark.long
def test_a_recording_verifies_and_forks_without_its_policy(scenario, tmp_path):
    summary = run(scenario, tmp_path / "parent")
    assert summary.measures["answers"] > 1
    (tmp_path / "data" / "policies" / "pick.py").unlink()
    assert trocar.verify(tmp_path / "parent").same
    with pytest.raises(TrustError, match=r"python:data/policies/pick\.py:Pick"):
        trocar.fork(tmp_path / "parent", 0.2)
    fork = trocar.fork(
        tmp_path / "parent",
        0.2,
        set={
            "participants.policy.backend": "python:policies.py:Still",
            "participants.governor.speed": "20 mm/s",
        },
        record=tmp_path / "fork",
        trust=True,
        directory=tmp_path,
    )
    assert fork.measures["faults"] == 0
    assert trocar.verify(tmp_path / "fork").same


def test_a_policy_that_dies_is_named_and_the_arm_holds(scenario, tmp_path):
    summary = run(scenario, tmp_path / "marked", **{"participants.policy.backend": "python:policies.py:dies"})
    assert summary.measures["faults"] >= 1
    recording = trocar.Recording(tmp_path / "marked")
    said = [message.data for _, message in recording["governor.warning"].messages()]
    assert any("has ended with exit code 3" in text for text in said)
    assert recording["governor.condition"]["data"][-1] == 3.0


def test_a_policy_with_another_contract_ends_the_session_at_its_start(scenario):
    with pytest.raises(ParticipantError, match="horizon: the policy has 99, the contract 15"):
        run(scenario, **{"participants.policy.backend": "python:policies.py:Claims"})
