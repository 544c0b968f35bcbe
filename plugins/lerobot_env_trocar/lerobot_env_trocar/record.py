"""Episodes of an exercise's oracle as a data set of LeRobot, to train its policies on.

python -m lerobot_env_trocar.record needle-pick --task NeedlePick-v0 --episodes 100
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lerobot_env_trocar.environment import LeRobotEnvironment  # isort: skip  (before numpy, as there)

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE

from lerobot_env_trocar.config import TrocarEnv
from trocar.environments import oracle

__all__ = ["record"]

FIRST_SEED = 10_000
"""Seed of the first episode; `lerobot-eval` begins at 1000, `trocar judge` at 0."""
_PUSHED, _PUSH = 0.2, 0.3
"""Share of steps with noise, and its standard deviation: episodes hold ways back from errors."""


def record(env: LeRobotEnvironment, dataset: LeRobotDataset, episodes: int) -> None:
    """Add episodes with success to a data set, seeds from `FIRST_SEED` on, until it has so many.

    A pushed step has the oracle's own action, though another was executed (DART, Laskey et al., CoRL 2017).
    """
    seed = FIRST_SEED
    while dataset.num_episodes < episodes:
        rng, expert = np.random.default_rng(seed), oracle(env.unwrapped)
        observation, info = env.reset(seed=seed)
        ended = False
        while not ended:
            action = expert(env.original(observation))
            dataset.add_frame(_frame(observation, action) | {"task": env.task_description})
            hands = action.reshape(-1, 5).copy()
            if rng.random() < _PUSHED:
                hands[:, :4] += rng.normal(0.0, _PUSH, hands[:, :4].shape)
            observation, _, terminated, truncated, info = env.step(hands.ravel().astype(np.float32))
            ended = terminated or truncated
        if info["is_success"]:
            dataset.save_episode()
        else:
            dataset.clear_episode_buffer()
        seed += 1


def _frame(observation: dict[str, Any], action: Any) -> dict[str, Any]:
    frame = {
        ACTION: action.astype(np.float32),
        OBS_STATE: observation["agent_pos"].astype(np.float32),
        OBS_ENV_STATE: observation["environment_state"].astype(np.float32),
    }
    return frame | {f"{OBS_IMAGES}.{eye}": one for eye, one in observation.get("pixels", {}).items()}


def _features(env: LeRobotEnvironment) -> dict[str, dict[str, Any]]:
    spaces = env.observation_space
    vectors = {
        ACTION: env.action_space,
        OBS_STATE: spaces["agent_pos"],
        OBS_ENV_STATE: spaces["environment_state"],
    }
    found = {key: {"dtype": "float32", "shape": one.shape, "names": None} for key, one in vectors.items()}
    for eye, picture in spaces["pixels"].items() if "pixels" in spaces.spaces else ():
        names = ["height", "width", "channels"]
        found[f"{OBS_IMAGES}.{eye}"] = {"dtype": "video", "shape": picture.shape, "names": names}
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Record the episodes asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("root", type=Path, help="directory of the data set, which must not exist")
    parser.add_argument("--task", default="NeedlePick-v0")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--pictures", action="store_true", help="with stereo pictures")
    given = parser.parse_args(arguments)
    env = LeRobotEnvironment(given.task, pictures=given.pictures)
    dataset = LeRobotDataset.create(
        repo_id=f"local/{given.root.name}",
        fps=TrocarEnv.fps,
        features=_features(env),
        root=given.root,
        robot_type="dvrk",
    )
    record(env, dataset, given.episodes)
    dataset.finalize()
    env.close()


if __name__ == "__main__":
    main()
