"""A Trocar environment with the observation keys of LeRobot."""

from __future__ import annotations

from typing import Any

from trocar.environments import register  # isort: skip  (before numpy: then hashes are the command line's)

import gymnasium
import numpy as np
from gymnasium import spaces

__all__ = ["LeRobotEnvironment"]

_HAND = 8
"""Numbers of a hand in an observation: position, quaternion, jaw."""
_WORDS = {
    "Reach-v0": "Bring the tip to the goal.",
    "NeedlePick-v0": "Pick up the needle and bring it to the goal.",
    "NeedleHandOver-v0": "Pick up the needle, hand it over and bring it to the goal.",
    "PegTransfer-v0": "Carry the ring to the other peg.",
    "BiPegTransfer-v0": "Carry the ring over the wall from hand to hand.",
    "PickAndPlace-v0": "Put the piece into the dish.",
    "Retraction-v0": "Lift the edge of the liver.",
    "Dissect-v0": "Burn the sheet off its bed.",
    "TissueCut-v0": "Cut a piece off the strip.",
}
"""Instructions by task."""

register()


class LeRobotEnvironment(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An exercise with the keys `pixels`, `agent_pos` and `environment_state`.

    Args:
        task: Name of the exercise, such as `NeedlePick-v0`.
        width: Of pictures, in pixels.
        height: Of pictures, in pixels.
        pictures: Whether there are pictures.
        episode_length: Steps of an episode; None: those of the exercise.
        arguments: Further arguments of Trocar's environment.
    """

    def __init__(
        self,
        task: str = "NeedlePick-v0",
        *,
        width: int = 320,
        height: int = 240,
        pictures: bool = True,
        episode_length: int | None = None,
        **arguments: Any,
    ) -> None:
        env = gymnasium.make(
            f"trocar/{task}",
            images=pictures,
            width=width,
            height=height,
            render_mode="rgb_array",
            terminate_on_success=True,
            max_episode_steps=episode_length,
            disable_env_checker=True,
            **arguments,
        )
        super().__init__(env)
        self.task = task
        self.task_description = _WORDS.get(task, task)
        self._max_episode_steps = int(env.spec.max_episode_steps)
        inner = env.unwrapped
        self._hands = _HAND * len(inner.exercise.hands)
        given: Any = env.observation_space
        size = self._hands + given["desired_goal"].shape[0]
        parts: dict[str, spaces.Space[Any]] = {
            "agent_pos": spaces.Box(-np.inf, np.inf, (size,), np.float32),
            "environment_state": given["observation"],
        }
        if pictures:
            parts["pixels"] = spaces.Dict({eye: given[eye] for eye in ("left", "right")})
        self.observation_space = spaces.Dict(parts)
        self.metadata = {**env.metadata, "render_fps": 5}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; options of LeRobot's own, such as `lerobot_new_rollout`, have no meaning here."""
        own = {name: value for name, value in (options or {}).items() if not name.startswith("lerobot_")}
        observation, info = self.env.reset(seed=seed, options=own or None)
        return self._rename(observation), info

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Act for a step."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._rename(observation), float(reward), terminated, truncated, info

    def original(self, observation: dict[str, Any]) -> dict[str, Any]:
        """Return an observation with Trocar's keys, as its oracles read them, without pictures."""
        goal = observation["agent_pos"][self._hands :]
        return {"observation": observation["environment_state"], "desired_goal": goal}

    def _rename(self, observation: dict[str, Any]) -> dict[str, Any]:
        state = observation["observation"]
        found = {
            "agent_pos": np.concatenate([state[: self._hands], observation["desired_goal"]]),
            "environment_state": state,
        }
        if "left" in observation:
            found["pixels"] = {eye: observation[eye] for eye in ("left", "right")}
        return found
