"""Heights of a sheet that is draped over tubes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["drape"]

Numbers = NDArray[np.float64]

_SLOPE = 0.8
"""How steeply the sheet falls off beside a tube. By eye."""
_BETWEEN = 8
"""Places between two points of a line."""


def drape(
    xs: Numbers, ys: Numbers, tubes: Sequence[tuple[Numbers, Numbers]], gap: float, floor: float
) -> Numbers:
    """Return heights over a grid of places, m, shape (len(ys), len(xs)).

    Args:
        xs: along x, m.
        ys: along y, m.
        tubes: points of a line, shape (k, 3), and outer radii, shape (k,), of each tube, m.
        gap: between a tube and the sheet, m.
        floor: lowest height, m.
    """
    x, y = np.meshgrid(xs, ys)
    heights = np.full(x.shape, floor)
    for line, radii in tubes:
        at = np.linspace(0.0, len(line) - 1.0, _BETWEEN * (len(line) - 1) + 1)
        own = np.arange(len(line), dtype=np.float64)
        px, py, pz, radius = (np.interp(at, own, values) for values in (*line.T, radii))
        for k in range(len(at)):
            away = np.hypot(x - px[k], y - py[k])
            top = pz[k] + radius[k] + gap - _SLOPE * np.maximum(away - 0.4 * radius[k], 0.0)
            heights = np.maximum(heights, top)
    return heights
