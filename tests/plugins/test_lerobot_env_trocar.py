"""The environment that LeRobot gets: keys, attributes, success; its type where LeRobot is installed."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from engines.mujoco.pictures import opengl

PLACE = Path(__file__).parents[2] / "plugins/lerobot_env_trocar"
PROGRAM = """
import sys; sys.path.insert(0, sys.argv[1])
from lerobot_env_trocar.env import make_env
from trocar.environments import oracle

class Config:
    task = "Reach-v0"
    gym_kwargs = {"width": 64, "height": 48, "episode_length": 20}

made = make_env(2, cfg=Config())
envs = made["trocar"][0]
observation, _ = envs.reset(seed=0, options={"lerobot_new_rollout": True})
assert observation["pixels"]["left"].shape == (2, 48, 64, 3), observation["pixels"]["left"].shape
assert str(observation["pixels"]["right"].dtype) == "uint8"
assert observation["agent_pos"].shape == (2, 11)
assert list(envs.call("_max_episode_steps")) == [20, 20]
assert envs.call("task_description")[0] and envs.call("task")[0] == "Reach-v0"
env = envs.envs[0]
assert (env.observation_space["agent_pos"].sample().shape) == (11,)
state, info = env.reset(seed=1)
policy, over = oracle(env.unwrapped), False
from_lerobot = lambda o: {"observation": o["environment_state"], "desired_goal": o["agent_pos"][-3:]}
while not over:
    state, reward, over, late, info = env.step(policy(from_lerobot(state)))
    assert not late
print("is_success", info["is_success"], env.render().shape)
envs.close()
"""


@pytest.mark.long
def test_envhub_gets_pictures_hands_and_success() -> None:
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    done = subprocess.run(
        [sys.executable, "-P", "-W", "ignore", "-c", PROGRAM, str(PLACE)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "is_success True (48, 64, 3)\n"


@pytest.mark.skipif(find_spec("lerobot") is None, reason="lerobot is not installed")
def test_lerobot_knows_the_type() -> None:
    program = (
        f"import sys; sys.path.insert(0, {str(PLACE)!r}); import lerobot_env_trocar;"
        "from lerobot.envs.factory import make_env_config;"
        "config = make_env_config('trocar', pictures=False);"
        "print(config.features['action'].shape)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "(5,)\n"
