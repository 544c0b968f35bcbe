"""Policies as the court sees them: begun for an episode, asked at every step.

| policy | meaning |
|---|---|
| `expert` | the exercise's oracle |
| `random` | uniform actions, seeded by the episode: the floor |
| `openpi://HOST:PORT`, ... | a policy behind a contract: the backends of kind `policy` |
| `MODULE:NAME` | a class or function without arguments, for an object with `begin` and `act` |

A policy that is a context manager is entered before the first trial and left after the last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from devices.policies.policy import BACKENDS
from learning.environments.environment import Environment, Observation
from learning.environments.oracles import oracle
from learning.judge.contract_policy import ContractPolicy
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["JudgedPolicy", "PolicyAddress", "open_policy"]


class JudgedPolicy(Protocol):
    """A policy on trial.

    Attributes:
        environment: arguments of the environments that the policy needs, such as `images`.
    """

    environment: Mapping[str, Any]

    def begin(self, env: Environment, seed: int) -> None:
        """Begin an episode of `env`; `seed` is the episode's."""
        ...

    def act(self, observation: Observation) -> NDArray[Any]:
        """Return the action of the next step."""
        ...


class Expert:
    """The oracle of the exercise."""

    environment: Mapping[str, Any] = MappingProxyType({})

    def begin(self, env: Environment, seed: int) -> None:  # noqa: ARG002
        """Plan anew."""
        self._oracle = oracle(env)

    def act(self, observation: Observation) -> NDArray[Any]:
        """Go on to the next waypoint."""
        return self._oracle(observation)


class RandomActions:
    """Uniform actions: the floor under all results."""

    environment: Mapping[str, Any] = MappingProxyType({})

    def begin(self, env: Environment, seed: int) -> None:
        """Seed the actions with the episode's seed."""
        self._rng = np.random.default_rng(seed)
        self._shape = env.action_space.shape

    def act(self, observation: Observation) -> NDArray[Any]:  # noqa: ARG002
        """Draw an action."""
        return self._rng.uniform(-1.0, 1.0, self._shape)


_OWN: dict[str, Callable[[], JudgedPolicy]] = {"expert": Expert, "random": RandomActions}


class PolicyAddress(NamedTuple):
    """Which policy is on trial, as the command names it."""

    name: str
    contract: Mapping[str, Any] | None = None
    """Entries of the contract of a backend; None: the court's own."""
    execute: int = 5
    """Rows of an answer of a backend executed before the next question."""


def open_policy(address: PolicyAddress) -> JudgedPolicy:
    """Return a policy. Raises ScenarioError if there is none, or if class or contract do not fit."""
    name = address.name
    module, colon, attribute = name.partition(":")
    if module in BACKENDS and colon:
        return ContractPolicy(name, address.contract or {}, address.execute)
    if address.contract is not None:
        raise ScenarioError(f"policy '{name}' has no contract; backends have: {', '.join(BACKENDS)}")
    if name in _OWN:
        return _OWN[name]()
    if not colon:
        raise ScenarioError(
            f"no policy '{name}'.{did_you_mean(name, _OWN)} Allowed: {', '.join(_OWN)}, an address of"
            f" {', '.join(BACKENDS)}, or MODULE:NAME of a class of your own"
        )
    try:
        made = getattr(import_module(module), attribute)()
    except (ImportError, AttributeError, TypeError) as error:
        raise ScenarioError(f"policy '{name}' cannot be made: {error}") from error
    if missing := [part for part in ("environment", "begin", "act") if not hasattr(made, part)]:
        raise ScenarioError(
            f"policy '{name}' has no {' and no '.join(missing)}: a policy has `environment`, `begin(env,"
            " seed)` and `act(observation)`"
        )
    return made
