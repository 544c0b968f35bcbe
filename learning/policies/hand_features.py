"""Features of what a robot knows without a camera: its hands, and the goal."""

from __future__ import annotations

import numpy as np

from learning.environments.environment import Environment, Observation
from learning.environments.oracles.waypoints import Seen
from learning.policies.state_features import UNIT, offset
from schemas.vectors import Vector

__all__ = ["HandFeatures"]


class HandFeatures:
    """Features of hands and goal in the observations of an environment; objects are left to pictures."""

    def __init__(self, env: Environment) -> None:
        self._layout, self._hands = env.layout, env.exercise.hands

    def __call__(self, observation: Observation) -> Vector:
        """Return the features, shape (n,)."""
        seen = Seen(self._layout, observation)
        parts = [seen.goal / UNIT]
        for hand in self._hands:
            tip = seen[f"{hand}/tip/position"]
            parts += [tip / UNIT, seen.matrix(f"{hand}/tip").ravel(), seen[f"{hand}/jaw"]]
            parts += offset(seen.goal[:3] - tip)
        return np.concatenate(parts)
