"""A line through the corners of a polygon, without sharp bends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["round_corners"]

_CUTS = 4
_POINTS = 16


def round_corners(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return even points along a polygon of corners (m, shape (k, 3)), rounded by Chaikin, shape (16, 3).

    The line begins and ends where the polygon does.
    """
    for _ in range(_CUTS):
        legs = np.stack([corners[:-1], corners[1:]], axis=1)
        cut = 0.75 * legs + 0.25 * legs[:, ::-1]
        corners = np.concatenate([corners[:1], cut.reshape(-1, 3), corners[-1:]])
    stations: NDArray[np.float64] = np.concatenate(
        [[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))]
    )
    even = np.linspace(0.0, float(stations[-1]), _POINTS)
    return np.stack([np.interp(even, stations, corners[:, axis]) for axis in range(3)], axis=1)
