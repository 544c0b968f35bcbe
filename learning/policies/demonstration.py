"""A demonstration in memory and in a file. numpy alone reads it: networks train where no simulator is."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.errors import ScenarioError

if TYPE_CHECKING:
    from schemas.vectors import Vector

__all__ = ["STEPS", "Demonstration", "chunks", "load_demonstrations"]

STEPS = 4
"""Number of steps that a network predicts: 0.8 s."""


class Demonstration(NamedTuple):
    """An episode: features, shape (steps, n), and the oracle's actions, shape (steps, 5 hands)."""

    seed: int
    features: Vector
    actions: Vector
    pictures: NDArray[np.uint8] | None = None
    """Pictures of the left and the right eye, shape (steps, 2, height, width, 3); None: not seen."""

    def save(self, file: Path) -> None:
        """Write the arrays into an .npz file; pictures as differences (modulo 256) from step to step.

        Most of a picture is as it was: differences take half the room.
        """
        arrays: dict[str, Any] = {"features": self.features, "actions": self.actions}
        if self.pictures is not None:
            arrays["differences"] = np.diff(self.pictures, axis=0, prepend=np.uint8(0))
        np.savez_compressed(file, seed=np.array(self.seed), **arrays)

    @classmethod
    def load(cls, file: Path) -> Demonstration:
        """Read a file of `save`; nothing is unpickled. Raises ScenarioError for another file."""
        try:
            with file.open("rb") as opened, np.load(opened, allow_pickle=False) as arrays:
                pictures = None
                if "differences" in arrays.files:
                    pictures = np.cumsum(arrays["differences"], axis=0, dtype=np.uint8)
                return cls(int(arrays["seed"]), arrays["features"], arrays["actions"], pictures)
        except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise ScenarioError(
                f"'{file}' holds no demonstration ({error}): record it with `python -m learning.policies`"
            ) from error


def load_demonstrations(directory: Path) -> list[Demonstration]:
    """Return the demonstrations of a directory, by seed."""
    return [Demonstration.load(file) for file in sorted(directory.glob("*.npz"))]


def chunks(demonstrations: Sequence[Demonstration]) -> tuple[Vector, Vector]:
    """Return features, shape (m, n), and the actions of the next STEPS steps, shape (m, STEPS * 5 hands).

    The last action of an episode goes on after the end.
    """
    features = np.concatenate([each.features for each in demonstrations])
    ahead = np.arange(STEPS)
    actions = [
        each.actions[np.minimum(np.arange(len(each.actions))[:, None] + ahead, len(each.actions) - 1)]
        for each in demonstrations
    ]
    return features, np.concatenate(actions).reshape(len(features), -1)
