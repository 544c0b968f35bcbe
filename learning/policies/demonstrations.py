"""Demonstrations: episodes of an oracle, as features and the actions of the next steps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learning.environments.environment import Environment
from learning.environments.oracles import oracle
from learning.policies.demonstration import Demonstration
from learning.policies.hand_features import HandFeatures
from learning.policies.state_features import StateFeatures
from schemas.vectors import Vector

__all__ = ["FIRST_SEED", "demonstrate"]

FIRST_SEED = 10_000
"""Seed of the first demonstration; the court begins at 0."""
_PUSHED = 0.2
"""Share of steps with noise."""


def demonstrate(
    env: Environment, count: int, steps: int, noise: float, first_seed: int = FIRST_SEED
) -> Iterator[Demonstration]:
    """Yield episodes of the oracle that reach the goal within `steps`; the others are dropped.

    The executed motion of a fifth of the steps is the oracle's plus noise; the recorded action is the
    oracle's own, so that demonstrations hold the way back from errors (as in DART, Laskey et al., CoRL 2017).

    Args:
        env: an environment with `terminate_on_success`; with `images`, pictures are kept, and features are
            those of the hands alone.
        count: number of episodes with success.
        steps: steps of an episode at most.
        noise: standard deviation of the noise on the four numbers of a hand's motion.
        first_seed: of the first episode.
    """
    seed, found = first_seed, 0
    while found < count:
        episode = _demonstrate(env, seed, steps, noise)
        seed += 1
        if episode is not None:
            found += 1
            yield episode


def _demonstrate(env: Environment, seed: int, steps: int, noise: float) -> Demonstration | None:
    """Return an episode, or None without success."""
    rng, expert = np.random.default_rng(seed), oracle(env)
    features = HandFeatures(env) if env.images else StateFeatures(env)
    observation, info = env.reset(seed=seed)
    seen: list[Vector] = []
    actions: list[Vector] = []
    pictures: list[NDArray[np.uint8]] = []
    ended = False
    while not ended and len(actions) < steps:
        seen.append(features(observation))
        if env.images:
            pictures.append(np.stack([observation["left"], observation["right"]]))
        actions.append(expert(observation))
        hands: NDArray[Any] = actions[-1].reshape(-1, 5).copy()
        if rng.random() < _PUSHED:
            hands[:, :4] += rng.normal(0.0, noise, hands[:, :4].shape)
        observation, _, ended, _, info = env.step(hands.ravel())
    if not info["is_success"]:
        return None
    return Demonstration(seed, np.array(seen), np.array(actions), np.array(pictures) if pictures else None)
