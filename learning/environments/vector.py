"""Environments of one exercise side by side: threads of this process, and the bits of one by one.

Physics runs in C without the lock of Python, so threads share the cores. All Python between two actions is
left out or done once for a step (`SteppedSession.leap`); what remains runs in turns.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from learning.environments.registration import make

__all__ = ["ThreadedVectorEnv", "make_vector"]


class _Started(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment with a step or reset that may run already."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.running: Future[Any] | None = None

    def step(self, action: Any) -> Any:
        """Return the result of the running step, or take a step."""
        return self.env.step(action) if self.running is None else self._take_result()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Return the result of the running reset, or reset."""
        if self.running is None:
            return self.env.reset(seed=seed, options=options)
        return self._take_result()

    def _take_result(self) -> Any:
        running, self.running = self.running, None
        assert running is not None
        return running.result()


class ThreadedVectorEnv(SyncVectorEnv[Any, Any]):
    """Gymnasium's `SyncVectorEnv` with the steps of all environments in threads.

    Args:
        env_fns: Functions that make the environments.
        threads: Threads; None: one for each core that this process may use.
        autoreset_mode: As in Gymnasium.
    """

    def __init__(
        self,
        env_fns: Sequence[Callable[[], gymnasium.Env[Any, Any]]],
        *,
        threads: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        self._started = [_Started(env_fn()) for env_fn in env_fns]
        makers: list[Any] = [partial(_return, env) for env in self._started]
        super().__init__(makers, autoreset_mode=autoreset_mode)  # pyright: ignore[reportUnknownMemberType]
        self._threads = ThreadPoolExecutor(threads or _cores(), thread_name_prefix="environment")

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Act in all environments for a step, as `SyncVectorEnv` does, side by side."""
        begins = self.autoreset_mode == AutoresetMode.NEXT_STEP
        running: list[Future[Any]] = []
        for env, action, over in zip(self._started, actions, self._autoreset_envs, strict=True):
            begin = self._threads.submit
            running.append(begin(env.env.reset) if begins and over else begin(env.env.step, action))
            env.running = running[-1]
        wait(running)
        return super().step(actions)

    def close_extras(self, **arguments: Any) -> None:
        """Close all environments and threads."""
        self._threads.shutdown()
        super().close_extras(**arguments)


def _return(env: _Started) -> _Started:
    return env


def make_vector(
    exercise: str,
    *,
    num_envs: int,
    max_episode_steps: int,
    threads: int | None = None,
    record: str | Path | None = None,
    hashed: bool = False,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    **arguments: Any,
) -> ThreadedVectorEnv:
    """Return `num_envs` environments of an exercise; `gymnasium.make_vec` calls this.

    `record`: a directory, with one for each environment. Further arguments are those of an environment.
    """

    def make_one(number: int) -> gymnasium.Env[Any, Any]:
        own = None if record is None else Path(record) / f"environment-{number:02d}"
        env = make(exercise, record=own, hashed=hashed, **arguments)
        return TimeLimit(env, max_episode_steps)

    env_fns = [partial(make_one, number) for number in range(num_envs)]
    return ThreadedVectorEnv(env_fns, threads=threads, autoreset_mode=autoreset_mode)


def _cores() -> int:
    """Return the number of cores for this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
