"""Statistics for a learner's normalisation: least, largest, mean, deviation and quantiles of each feature."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["PictureCounts", "vector_statistics"]

_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_EVERY = 4
"""Step between counted pixels on both sides of a picture, as in LeRobot from 600 pixels on."""
_LEVELS = 256


def vector_statistics(rows: NDArray[Any]) -> dict[str, list[Any]]:
    """Return the statistics of the columns of `rows`, shape (n, k), as lists of k, and `count`."""
    rows = rows.astype(np.float64)
    found = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0)}
    found |= {"std": rows.std(axis=0)}
    found |= dict(zip(_QUANTILES, np.quantile(rows, list(_QUANTILES.values()), axis=0), strict=True))
    return {name: value.tolist() for name, value in found.items()} | {"count": [len(rows)]}


class PictureCounts:
    """Counts of each level of each channel in pictures; all statistics follow exactly."""

    def __init__(self) -> None:
        self._levels = np.zeros((3, _LEVELS), np.int64)
        self._pictures = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Count a picture, shape (height, width, 3)."""
        some = picture[::_EVERY, ::_EVERY].reshape(-1, 3)
        for channel, levels in enumerate(self._levels):
            levels += np.bincount(some[:, channel], minlength=_LEVELS)
        self._pictures += 1

    def merge(self, other: PictureCounts) -> None:
        """Count the pictures of `other` too."""
        self._levels += other._levels
        self._pictures += other._pictures

    def statistics(self) -> dict[str, list[Any]]:
        """Return the statistics of the channels, black 0 and white 1, shape (3, 1, 1), and `count`."""
        level = np.arange(_LEVELS) / (_LEVELS - 1)
        share = self._levels / self._levels.sum(axis=1, keepdims=True)
        mean = share @ level
        found = {
            "min": level[(share > 0).argmax(axis=1)],
            "max": level[_LEVELS - 1 - (share[:, ::-1] > 0).argmax(axis=1)],
            "mean": mean,
            "std": np.sqrt(np.maximum(share @ level**2 - mean**2, 0.0)),
        }
        below = share.cumsum(axis=1)
        # the sum of all shares is 1 but for rounding
        found |= {name: level[(below < q - 1e-12).sum(axis=1)] for name, q in _QUANTILES.items()}
        return {name: value.reshape(3, 1, 1).tolist() for name, value in found.items()} | {
            "count": [self._pictures]
        }
