"""A network as numbers in a file: evaluated by numpy, so that a trained policy needs no PyTorch."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schemas.errors import ScenarioError

if TYPE_CHECKING:
    from schemas.vectors import Vector

__all__ = ["Network"]


@dataclass(frozen=True)
class Network:
    """Linear layers with rectifiers between, of normalised features."""

    mean: Vector
    """Mean of the features, shape (n,)."""
    scale: Vector
    """Standard deviation of the features, shape (n,)."""
    weights: list[Vector]
    """Weights of each layer, shape (outputs, inputs)."""
    biases: list[Vector]
    """Biases of each layer, shape (outputs,)."""
    steps: int
    """Number of steps for which actions are predicted."""

    def __call__(self, features: Vector) -> Vector:
        """Return the actions of the next steps, shape (steps, 5 hands)."""
        values = (features - self.mean) / self.scale
        for weights, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            values = np.maximum(weights @ values + bias, 0.0)
        return (self.weights[-1] @ values + self.biases[-1]).reshape(self.steps, -1)

    def save(self, file: Path) -> None:
        """Write the arrays into an .npz file."""
        layers: dict[str, Any] = {f"weights_{i}": each for i, each in enumerate(self.weights)}
        layers |= {f"biases_{i}": each for i, each in enumerate(self.biases)}
        np.savez(file, mean=self.mean, scale=self.scale, steps=np.array(self.steps), **layers)

    @classmethod
    def load(cls, file: Path) -> Network:
        """Read a file of `save`; nothing is unpickled. Raises ScenarioError for another file."""
        try:
            with file.open("rb") as opened, np.load(opened, allow_pickle=False) as arrays:
                count = sum(name.startswith("weights_") for name in arrays.files)
                return cls(
                    arrays["mean"],
                    arrays["scale"],
                    [arrays[f"weights_{i}"] for i in range(count)],
                    [arrays[f"biases_{i}"] for i in range(count)],
                    int(arrays["steps"]),
                )
        except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise ScenarioError(
                f"'{file}' holds no network ({error}): train it with `python -m learning.policies`"
            ) from error
