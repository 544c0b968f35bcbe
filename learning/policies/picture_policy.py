"""A policy learnt from pictures, as the court takes policies.

trocar judge --policy learning.policies.picture_policy:PicturePolicy --suite NeedlePick -o verdict
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import torch

from learning.environments.environment import Environment, Observation
from learning.policies.demonstration import STEPS
from learning.policies.hand_features import HandFeatures
from learning.policies.picture_network import PictureNetwork
from schemas.errors import ScenarioError
from schemas.vectors import Vector

__all__ = ["PICTURES", "PicturePolicy"]

PICTURES: Mapping[str, Any] = MappingProxyType({"images": True, "width": 224, "height": 168})
"""Arguments of environments for demonstrations and trials."""


class PicturePolicy:
    """Predicts a chunk at every step; the action leads to the mean of all predictions for the step.

    Motions of a chunk are added up to places and turns before the mean. A mean of motions would repeat
    corrections that are already made, and swing about the goal. Observed are stereo pictures, tips, jaws and
    the goal, but no object's place.

    Attributes:
        directory: Directory of the networks, `EXERCISE-pictures.npz` each, below the current directory.
    """

    environment: Mapping[str, Any] = PICTURES
    directory = Path("clones")

    def begin(self, env: Environment, seed: int) -> None:  # noqa: ARG002
        """Load the network of the exercise. Raises ScenarioError if there is none."""
        file = self.directory / f"{type(env.exercise).__name__}-pictures.npz"
        if not file.is_file():
            raise ScenarioError(
                f"no network '{file}': train it with `python -m learning.policies EXERCISE --pictures`"
            )
        self._features, self._network = HandFeatures(env), PictureNetwork.load(file)
        self._chunks: deque[Vector] = deque(maxlen=STEPS)
        self._moved = np.zeros((len(env.exercise.hands), 4))

    def act(self, observation: Observation) -> Vector:
        """Return the action of the next step, shape (5 hands,)."""
        pictures = torch.from_numpy(np.stack([observation["left"], observation["right"]])[None])
        features = torch.tensor(self._features(observation)[None], dtype=torch.float32)
        with torch.inference_mode():
            predicted = self._network(pictures, features).numpy().astype(np.float64)
        chunk = predicted.reshape(STEPS, -1, 5)
        chunk[..., :4] = self._moved + np.cumsum(np.clip(chunk[..., :4], -1.0, 1.0), axis=0)
        self._chunks.append(chunk)
        ages = range(len(self._chunks) - 1, -1, -1)
        action = np.mean([each[age] for each, age in zip(self._chunks, ages, strict=True)], axis=0)
        action[:, :4] = np.clip(action[:, :4] - self._moved, -1.0, 1.0)
        self._moved += action[:, :4]
        action[:, 4] = np.where(action[:, 4] < 0.0, -1.0, 1.0)
        return action.ravel()
