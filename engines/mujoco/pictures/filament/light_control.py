"""Automatic light: the source of an endoscope is dimmed until tissue has a fixed mean brightness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["LightControl"]

_GOAL = 112.0
"""Mean brightness of the middle of a picture, grey levels of 255."""
_BRIGHTEST = 190.0
"""Largest goal, grey levels."""
_GLARE, _GLARE_SHARE = 240.0, 0.04
"""Grey level, and the share of the middle that may be brighter."""
_GAMMA = 1.8
"""Light goes with this power of grey levels, about, below the shoulder of the tone curve."""
_LAG = 0.25
"""Share of the way to the goal for each picture."""
_RANGE = 0.02, 12.0
_STRIDE = 4
"""Every fourth pixel counts."""


class LightControl:
    """Keeps the light as a factor of its usual intensity."""

    def __init__(self, exposure: float = 0.0) -> None:
        """`exposure`: stops by which pictures are brighter than usual."""
        self._goal = min(_GOAL * 2.0 ** (exposure / _GAMMA), _BRIGHTEST)
        self.factor = 1.0
        """Present light over usual light."""

    def follow(self, picture: NDArray[np.uint8], lag: float = _LAG) -> bool:
        """Set the light by a picture, shape (height, width, 3); return whether it was far from the goal."""
        height, width, _ = picture.shape
        middle = picture[height // 6 : -height // 6 : _STRIDE, width // 6 : -width // 6 : _STRIDE]
        mean = max(float(middle.mean()), 2.0)
        glare = float(np.quantile(middle.max(axis=2), 1.0 - _GLARE_SHARE))
        wanted = min(self._goal / mean, _GLARE / max(glare, 1.0)) ** _GAMMA if glare < 254.0 else 0.6
        self.factor = float(np.clip(self.factor * wanted**lag, *_RANGE))
        return abs(wanted - 1.0) > 0.1
