"""Places of clips and cut along a tube.

Two clips stay on the patient's side of the cut, the third goes with the gallbladder. Wanted are a gap of 2 mm
or more between clips, a cuff of 1 to 3 mm at the cut, and 5 mm to the common bile duct. On a short tube all
distances shrink alike, down to the least. Sources: docs/how-to/clip-and-cut.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = ["LEAST_LENGTH", "Places", "choose_places"]

_WANTED = np.array([3.5e-3, 3.0e-3, 3.0e-3, 4.0e-3, 5.6e-3])
"""Gallbladder to clip 3, to the cut, to clip 2, to clip 1, to the end of the tube; middles of clips, m."""
_LEAST = np.array([1.5e-3, 1.6e-3, 1.6e-3, 2.0e-3, 1.5e-3])
"""Least of these distances, m: room for half a jaw in soft tissue, cuffs of 1 mm, clips side by side."""
LEAST_LENGTH = float(_LEAST.sum())
"""Length of the shortest tube with room for three clips and the cut, m."""


class Places(NamedTuple):
    """Distances along a tube at rest, from the gallbladder's end, m."""

    clips: Vector
    """Clips 1 and 2, on the patient's side, and clip 3, shape (3,)."""
    cut: float
    is_roomy: bool
    """Whether there is room for all wanted distances."""


def choose_places(length: float, begin: float = 0.0) -> Places:
    """Return the places on a tube of `length`, m: near the gallbladder if there is a choice.

    `begin`: where the tube is free of the gallbladder, m; the third clip goes there if there is room.

    Raises MotionError for a tube without room.
    """
    if length < LEAST_LENGTH:
        raise MotionError(
            f"a tube of {1e3 * length:.1f} mm has no room for three clips and a cut:"
            f" {1e3 * LEAST_LENGTH:.1f} mm at least"
        )
    wanted = float(_WANTED.sum())
    share = min(1.0, (length - LEAST_LENGTH) / (wanted - LEAST_LENGTH))
    distances = _LEAST + share * (_WANTED - _LEAST)
    distances[0] += min(max(0.0, begin - float(distances[0])), max(0.0, length - wanted))
    third, cut, second, first = np.cumsum(distances)[:4].tolist()
    return Places(np.array([first, second, third]), cut, share == 1.0)
