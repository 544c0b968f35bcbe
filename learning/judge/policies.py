"""Policies as the court sees them: begun for an episode, asked at every step.

| policy | meaning |
|---|---|
| `expert` | the exercise's oracle |
| `random` | uniform actions, seeded by the episode: the floor |
| `hold` | no motion, jaws open |
| `MODULE:NAME` | a class or function without arguments, for an object with `begin` and `act` |
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from learning.environments.environment import Environment, Observation
from learning.environments.oracles import oracle
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["JudgedPolicy", "open_policy"]


class JudgedPolicy(Protocol):
    """A policy on trial.

    Attributes:
        images: whether observations have pictures.
    """

    images: bool

    def begin(self, env: Environment, seed: int) -> None:
        """Begin an episode of `env`; `seed` is the episode's."""
        ...

    def act(self, observation: Observation) -> NDArray[Any]:
        """Return the action of the next step."""
        ...


class Expert:
    """The oracle of the exercise."""

    images = False

    def begin(self, env: Environment, seed: int) -> None:  # noqa: ARG002
        """Plan anew."""
        self._oracle = oracle(env)

    def act(self, observation: Observation) -> NDArray[Any]:
        """Go on to the next waypoint."""
        return self._oracle(observation)


class RandomActions:
    """Uniform actions: the floor under all results."""

    images = False

    def begin(self, env: Environment, seed: int) -> None:
        """Seed the actions with the episode's seed."""
        self._rng = np.random.default_rng(seed)
        self._shape = env.action_space.shape

    def act(self, observation: Observation) -> NDArray[Any]:  # noqa: ARG002
        """Draw an action."""
        return self._rng.uniform(-1.0, 1.0, self._shape)


class Hold:
    """No motion."""

    images = False

    def begin(self, env: Environment, seed: int) -> None:  # noqa: ARG002
        """Know the number of hands."""
        self._shape = env.action_space.shape

    def act(self, observation: Observation) -> NDArray[Any]:  # noqa: ARG002
        """Stay, with open jaws."""
        return np.zeros(self._shape or ())


_OWN: dict[str, type[JudgedPolicy]] = {"expert": Expert, "random": RandomActions, "hold": Hold}


def open_policy(name: str) -> JudgedPolicy:
    """Return a policy by name. Raises ScenarioError if there is none, or if the class does not fit."""
    if name in _OWN:
        return _OWN[name]()
    module, colon, attribute = name.partition(":")
    if not colon:
        raise ScenarioError(
            f"no policy '{name}'.{did_you_mean(name, _OWN)} Allowed: {', '.join(_OWN)}, or MODULE:NAME of"
            " a class of your own"
        )
    try:
        made = getattr(import_module(module), attribute)()
    except (ImportError, AttributeError, TypeError) as error:
        raise ScenarioError(f"policy '{name}' cannot be made: {error}") from error
    if missing := [part for part in ("images", "begin", "act") if not hasattr(made, part)]:
        raise ScenarioError(
            f"policy '{name}' has no {' and no '.join(missing)}: a policy has `images`, `begin(env, seed)`"
            " and `act(observation)`"
        )
    return made
