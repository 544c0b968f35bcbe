"""Policies in processes of their own: answers, and everything that can go wrong with them."""

from pathlib import Path

import numpy as np
import pytest

from devices.policies.inference import Inference
from devices.policies.params import PolicyParams
from devices.policies.policy import Observation, open_policy
from schemas.errors import DeviceError, MessageError, ScenarioError
from schemas.ros import Header, Time
from schemas.trocar_msgs import PolicyObservation

HERE = Path(__file__).parent
STATE = np.array([0.0, 0.0, -0.12, 0.0, 0.0, 0.0, 1.0, 0.3], np.float32)


def backend(name):
    return f"python:policies.py:{name}"


def terms(name="Still", **contract):
    given = {"arms": {"PSM1": {"instrument": "400006"}}, "backend": backend(name)}
    return PolicyParams.model_validate({**given, "contract": {"horizon": 2, **contract}}).terms


@pytest.fixture
def opened():
    policies = []

    def make(name, timeout_s=20.0):
        policies.append(open_policy(backend(name), terms(name), timeout_s=timeout_s, directory=HERE))
        return policies[-1]

    yield make
    for policy in policies:
        policy.close()


def ask(policy, number=1):
    return policy.act(Observation(number, {"left": np.zeros((16, 16, 3), np.uint8)}, STATE, "stay"))


def test_a_class_answers_with_rows_whatever_it_prints(opened):
    policy = opened("Still")
    policy.reset(3)
    assert ask(policy) == pytest.approx(np.tile(STATE, (2, 1)).astype(float))
    assert ask(policy, 2).dtype == np.float64


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "error", "said"),
    [
        ("text", DeviceError, "an array of <U7 cannot be sent"),
        ("not_a_number", MessageError, "nan at row 0, 'psm1_sp.position.x': not finite"),
        ("too_wide", MessageError, r"shape \(1, 9\): the contract has 1 to 2 rows of 8 \(open-h-dvrk\)"),
        ("huge", MessageError, "1073741824 bytes; at most 67108864"),
        ("raises", DeviceError, r"RuntimeError: no plan \(policies.py, line"),
        ("dies", DeviceError, "has ended with exit code 3"),
    ],
)
def test_a_bad_answer_is_named(opened, name, error, said):
    with pytest.raises(error, match=said):
        ask(opened(name))


def test_a_slow_policy_is_named(opened):
    policy = opened("slow", timeout_s=20.0)
    policy._timeout_s = 0.2
    with pytest.raises(DeviceError, match=r"has not answered within 0\.2 s"):
        ask(policy)


def test_an_answer_to_another_question_is_not_taken(opened):
    policy = opened("Still")
    policy._answers.put({"number": 0, "actions": np.zeros((1, 8))})  # of a question given up before
    assert ask(policy)[0, 7] == pytest.approx(0.3)
    policy._answers.put({"number": 77, "actions": np.zeros((1, 8))})
    with pytest.raises(MessageError, match="answers question 77, not 2"):
        ask(policy, 2)


def test_a_statement_that_does_not_fit_the_contract_is_named(opened):
    with pytest.raises(
        ScenarioError, match=r"horizon: the policy has 99, the contract 2; action: .* 20 numbers"
    ):
        opened("Claims")


@pytest.mark.parametrize(
    ("name", "said"), [("missing", "AttributeError"), ("Still.nothing", "AttributeError")]
)
def test_a_name_that_is_not_there_is_named(opened, name, said):
    with pytest.raises(DeviceError, match=f"cannot be started: {said}"):
        opened(name)


def test_an_interpreter_that_is_not_there_is_named():
    with pytest.raises(DeviceError, match="cannot be started"):
        open_policy(backend("Still"), terms(), directory=HERE, python="/no/python")


def test_a_policy_that_dies_in_mid_episode_is_a_fault_and_comes_again(monkeypatch):
    monkeypatch.setattr("devices.policies.inference._RETRY_S", 0.0)
    inference = Inference(lambda: open_policy(backend("recovers"), terms("recovers"), directory=HERE), 0)
    assert inference.open() == ""
    faults = []
    for number in (1, 2, 3):
        asked = PolicyObservation(
            header=Header(stamp=Time.from_ns(5)), number=number, state=STATE, tips=STATE[:7]
        )
        faults.append(inference.answer(asked, Observation(number, {}, STATE)).fault)
    inference.close()
    assert (faults[0], faults[2]) == ("", "")
    assert "has ended with exit code 4" in faults[1]
