"""A policy learnt by imitation, as the court takes policies.

trocar judge --policy learning.policies.cloned_policy:ClonedPolicy --suite NeedlePick -o verdict
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from learning.environments.environment import Environment, Observation
from learning.policies.network import Network
from learning.policies.state_features import StateFeatures
from schemas.errors import ScenarioError
from schemas.vectors import Vector

__all__ = ["ClonedPolicy"]

EXECUTED = 3
"""Number of predicted actions to be executed."""


class ClonedPolicy:
    """Executes the first EXECUTED predicted actions, then predicts anew.

    A policy that predicts anew at every step can stay for ever where its teacher has gone on by a threshold
    that no observation shows; a chunk of actions takes it past that point.

    Attributes:
        directory: Directory of the networks, `EXERCISE.npz` each, below the current directory.
    """

    environment: Mapping[str, Any] = MappingProxyType({})
    directory = Path("clones")

    def begin(self, env: Environment, seed: int) -> None:  # noqa: ARG002
        """Load the network of the exercise. Raises ScenarioError if there is none, or a wrong size."""
        file = self.directory / f"{type(env.exercise).__name__}.npz"
        if not file.is_file():
            raise ScenarioError(f"no network '{file}': train it with `python -m learning.policies`")
        self._features, self._network = StateFeatures(env), Network.load(file)
        self._rest: list[Vector] = []

    def act(self, observation: Observation) -> Vector:
        """Return the action of the next step, shape (5 hands,)."""
        if not self._rest:
            chunk = self._network(self._features(observation))
            chunk[:, 4::5] = np.where(chunk[:, 4::5] < 0.0, -1.0, 1.0)
            self._rest = list(chunk[:EXECUTED])
        return self._rest.pop(0)
