"""Environments in threads: the bits of one by one, restarts, errors, and what leaps refuse."""

import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction

import trocar
from schemas.errors import ParticipantError, SessionError
from trocar.environments import oracle

pytestmark = pytest.mark.xdist_group("environments")
PARTICIPANTS = ("actions", "robot", "task")


def states(env):
    """Return the whole state of an environment, and the newest values of its robot."""
    session = env.unwrapped._session
    ports = ("PSM1/measured_js", "PSM1/setpoint_js", "PSM1/jaw/measured_js", "qpos")
    return [session.participant(name).save() for name in PARTICIPANTS] + [
        session[f"robot.{port}"].tobytes() for port in ports
    ]


@pytest.mark.parametrize(
    ("name", "steps"),
    [("Reach", 6), ("NeedlePick", 16), ("NeedleHandOver", 24), ("PegTransfer", 20), ("PickAndPlace", 16)],
)
def test_a_leap_has_the_bits_of_single_steps(name, steps):
    """Led by the oracle: approach, grasp and, of the hand-over, the exchange."""
    plain = gymnasium.make(f"trocar/{name}-v0").unwrapped
    leaping = gymnasium.make(f"trocar/{name}-v0", hashed=False).unwrapped
    assert leaping._session.leaps
    observation, _ = plain.reset(seed=3)
    leaping.reset(seed=3)
    policy = oracle(plain)
    for _ in range(steps):
        action = policy(observation)
        observation, *rest = plain.step(action)
        again, *others = leaping.step(action)
        assert all(np.array_equal(observation[key], again[key]) for key in observation)
        assert rest == others
        assert states(plain) == states(leaping)
    with pytest.raises(SessionError, match="no state hash after a leap"):
        _ = leaping.state_hash
    plain.close()
    leaping.close()


def test_make_vec_has_the_bits_of_one_by_one_and_restarts_what_is_over():
    envs = gymnasium.make_vec("trocar/NeedlePick-v0", num_envs=3, max_episode_steps=2, threads=2)
    alone = [gymnasium.make("trocar/NeedlePick-v0", max_episode_steps=2) for _ in range(3)]
    seen, _ = envs.reset(seed=5)
    for i, env in enumerate(alone):
        env.reset(seed=5 + i)
    rng = np.random.default_rng(0)
    for step in range(5):
        actions = rng.uniform(-1.0, 1.0, (3, 5)).astype(np.float32)
        seen, rewards, _, late, infos = envs.step(actions)
        for i, env in enumerate(alone):
            if step == 2:  # the step after an end is the reset
                observation, reward = env.reset()[0], 0.0
            else:
                observation, reward, *_ = env.step(actions[i])
            assert all(np.array_equal(observation[key], seen[key][i]) for key in observation)
            assert rewards[i] == reward
            assert states(env) == states(envs.envs[i])
        assert late.tolist() == [step in (1, 4)] * 3
        assert set(infos) >= {"is_success", "bonus"}
    envs.close()
    for env in alone:
        env.close()


def test_an_action_that_is_none_stops_nothing_else():
    envs = gymnasium.make_vec("trocar/Reach-v0", num_envs=2)
    envs.reset(seed=0)
    actions = np.zeros((2, 5), np.float32)
    actions[1] = np.nan
    with pytest.raises(InvalidAction, match="finite numbers"):
        envs.step(actions)
    envs.step(np.zeros((2, 5), np.float32))
    envs.close()


def test_a_recorded_vector_goes_step_by_step_and_verifies(tmp_path):
    envs = gymnasium.make_vec("trocar/Reach-v0", num_envs=2, record=tmp_path)
    envs.reset(seed=1)
    envs.step(np.full((2, 5), 0.5, np.float32))
    envs.close()
    for number in range(2):
        assert trocar.verify(tmp_path / f"environment-{number:02d}/episode-00000").same


def test_arms_without_position_servo_go_step_by_step_only():
    env = gymnasium.make("trocar/Reach-v0", hashed=False).unwrapped
    env.reset(seed=0)
    env._session.advance(1, {"robot.PSM1/control_mode": np.zeros(2)})
    with pytest.raises(ParticipantError, match="use `advance`"):
        env._session.leap(10)
    env.close()


def test_tissue_goes_step_by_step():
    env = gymnasium.make("trocar/TissueCut-v0", hashed=False).unwrapped
    assert not env._session.leaps
    env.reset(seed=0)
    env.step(np.zeros(10))
    assert env.state_hash
    env.close()
