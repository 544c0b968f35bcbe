"""Behaviour cloning: demonstrations, features, networks in files, and a clone on trial."""

from itertools import pairwise

import numpy as np
import pytest

from learning.environments.registration import ENVIRONMENTS, make
from learning.judge.episode import Trial, judge_trial, make_environment
from learning.judge.policies import PolicyAddress, open_policy
from learning.policies.cloned_policy import ClonedPolicy
from learning.policies.demonstrations import FIRST_SEED, demonstrate
from learning.policies.network import Network
from learning.policies.state_features import StateFeatures
from schemas.errors import ScenarioError

TRIAL = Trial("NeedlePick", "nominal", 0)


@pytest.fixture(scope="module")
def episodes():
    kind, steps = ENVIRONMENTS["trocar/NeedlePick-v0"]
    env = make(kind, terminate_on_success=True, hashed=False)
    yield [*demonstrate(env, 2, steps, 0.1)]
    env.close()


def network_of(numbers, rng, *sizes):
    weights = [rng.normal(size=(b, a)) for a, b in pairwise(sizes)]
    return Network(np.zeros(numbers), np.ones(numbers), weights, [np.zeros(len(each)) for each in weights], 2)


def test_demonstrations_succeed_and_hold_the_oracles_own_actions(episodes):
    assert [each.seed >= FIRST_SEED for each in episodes] == [True, True]
    for each in episodes:
        assert len(each.features) == len(each.actions) > 5
        assert np.abs(each.actions).max() <= 1.0
        assert set(each.actions[:, 4]) == {-1.0, 1.0}


@pytest.mark.parametrize("exercise", ["NeedlePick", "NeedleHandOver", "PegTransfer"])
def test_features_are_finite_and_of_the_size_of_a_motion(exercise):
    env = make_environment(Trial(exercise, "nominal", 0), {})
    observation, _ = env.reset(seed=3)
    features = StateFeatures(env)(observation)
    env.close()
    assert np.isfinite(features).all()
    assert np.abs(features).max() < 30.0


def test_a_network_comes_back_from_its_file(tmp_path):
    rng = np.random.default_rng(0)
    network = network_of(7, rng, 7, 8, 10)
    network.save(tmp_path / "a.npz")
    seen = rng.normal(size=7)
    answer = network(seen)
    assert answer.shape == (2, 5)
    assert (Network.load(tmp_path / "a.npz")(seen) == answer).all()


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04rest"])
def test_another_file_is_no_network(tmp_path, content):
    file = tmp_path / "a.npz"
    file.write_bytes(content)
    with pytest.raises(ScenarioError, match="holds no network"):
        Network.load(file)


def test_arrays_of_objects_are_not_unpickled(tmp_path):
    file = tmp_path / "a.npz"
    np.savez(file, mean=np.array([{}], dtype=object))
    with pytest.raises(ScenarioError, match="holds no network"):
        Network.load(file)


def test_a_clone_without_its_network_says_how_to_train(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    policy = open_policy(PolicyAddress("learning.policies.cloned_policy:ClonedPolicy"))
    env = make_environment(TRIAL, policy.environment)
    row = judge_trial(env, policy, TRIAL, None)
    env.close()
    assert "python -m learning.policies" in row["error"]


def test_predicted_actions_are_executed_with_a_jaw_open_or_closed(tmp_path, monkeypatch):
    env = make_environment(TRIAL, {})
    observation, _ = env.reset(seed=0)
    numbers = len(StateFeatures(env)(observation))
    rows = np.zeros((4, 5))
    rows[:, 0], rows[:, 4] = [0.4, 0.3, 0.2, 0.1], [-0.2, 0.9, -0.9, 0.1]
    Network(np.zeros(numbers), np.ones(numbers), [np.zeros((20, numbers))], [rows.ravel()], 4).save(
        tmp_path / "NeedlePick.npz"
    )
    monkeypatch.setattr(ClonedPolicy, "directory", tmp_path)
    policy = ClonedPolicy()
    policy.begin(env, 0)
    acted = [policy.act(observation)[[0, 4]] for _ in range(4)]
    assert np.array(acted) == pytest.approx(np.array([[0.4, -1.0], [0.3, 1.0], [0.2, -1.0], [0.4, -1.0]]))
    env.close()


def test_a_clone_is_trained_and_judged(episodes, tmp_path, monkeypatch):
    pytest.importorskip("torch")
    from learning.policies.training import STEPS, train

    network = train(episodes, iterations=300)
    features, actions = episodes[0].features, episodes[0].actions
    assert network(features[0]).shape == (STEPS, 5)
    errors = [np.abs(network(seen)[0] - done).mean() for seen, done in zip(features, actions, strict=True)]
    assert np.mean(errors) < 0.1
    network.save(tmp_path / "NeedlePick.npz")
    monkeypatch.setattr(ClonedPolicy, "directory", tmp_path)
    env = make_environment(TRIAL, {})
    row = judge_trial(env, ClonedPolicy(), TRIAL, None)
    env.close()
    assert row["error"] is None
    assert row["steps"] > 5
