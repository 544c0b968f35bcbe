"""`make_env`, as EnvHub calls it."""

from __future__ import annotations

from functools import partial
from typing import Any

from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from lerobot_env_trocar.environment import LeRobotEnvironment

__all__ = ["make_env"]


def make_env(
    n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None
) -> dict[str, dict[int, VectorEnv[Any, Any, Any]]]:
    """Return `{"trocar": {0: environments}}`.

    Args:
        n_envs: Number of environments.
        use_async_envs: A process for each environment.
        cfg: An object with the attributes `task` and `gym_kwargs`; None: `NeedlePick-v0`.
    """
    task = (cfg.task if cfg is not None else None) or "NeedlePick-v0"
    arguments = dict(cfg.gym_kwargs) if cfg is not None else {}
    make = [partial(LeRobotEnvironment, task, **arguments)] * n_envs
    if use_async_envs and n_envs > 1:
        envs: VectorEnv[Any, Any, Any] = AsyncVectorEnv(
            make, context="spawn", autoreset_mode=AutoresetMode.SAME_STEP
        )
    else:
        envs = SyncVectorEnv(make, autoreset_mode=AutoresetMode.SAME_STEP)
    return {"trocar": {0: envs}}
