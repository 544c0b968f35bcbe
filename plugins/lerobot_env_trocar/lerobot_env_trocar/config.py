"""Configuration `--env.type=trocar` of LeRobot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE, OBS_IMAGES, OBS_STATE

__all__ = ["TrocarEnv"]


@EnvConfig.register_subclass("trocar")
@dataclass
class TrocarEnv(EnvConfig):
    """A training scene of Trocar."""

    task: str | None = "NeedlePick-v0"
    fps: int = 5
    width: int = 320
    height: int = 240
    pictures: bool = True
    episode_length: int | None = None
    features_map: dict[str, str] = field(
        default_factory=lambda: {
            ACTION: ACTION,
            "agent_pos": OBS_STATE,
            "environment_state": OBS_ENV_STATE,
            "pixels/left": f"{OBS_IMAGES}.left",
            "pixels/right": f"{OBS_IMAGES}.right",
        }
    )

    def __post_init__(self) -> None:
        """Read the shapes of actions and observations off the exercise."""
        from lerobot_env_trocar.environment import LeRobotEnvironment

        env = LeRobotEnvironment(self.task or "NeedlePick-v0", pictures=False)
        self.features = {ACTION: PolicyFeature(type=FeatureType.ACTION, shape=env.action_space.shape)}
        for key, kind in (("agent_pos", FeatureType.STATE), ("environment_state", FeatureType.ENV)):
            self.features[key] = PolicyFeature(type=kind, shape=env.observation_space[key].shape)
        env.close()
        for eye in ("left", "right") if self.pictures else ():
            shape = (self.height, self.width, 3)
            self.features[f"pixels/{eye}"] = PolicyFeature(type=FeatureType.VISUAL, shape=shape)

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of an environment."""
        names = ("width", "height", "pictures", "episode_length")
        return {name: getattr(self, name) for name in names}

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, Any]]:
        """Return the environments of the task."""
        from lerobot_env_trocar.env import make_env

        return make_env(n_envs, use_async_envs, self)
