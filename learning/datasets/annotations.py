"""Data sets of pictures with annotations: the base of COCO's and BOP's layouts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.truth.recorded_truth import RecordedTruth
from learning.datasets.truth import Stereo

__all__ = ["Annotations", "rounded"]


class Annotations(ABC):
    """A data set that grows by recordings."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    @abstractmethod
    def begin(self, truth: RecordedTruth, source: Mapping[str, Any]) -> None:
        """Begin a recording; `source`: where it is from."""

    @abstractmethod
    def add(self, truth: RecordedTruth, stereo: Stereo) -> None:
        """Append the pictures of both eyes at one time."""

    @abstractmethod
    def close(self) -> None:
        """Write what belongs to the whole data set."""


def rounded(values: NDArray[np.float64], digits: int = 6) -> list[float]:
    """Return numbers as JSON has them, without digits that mean nothing."""
    return np.round(values, digits).tolist()
