"""Places of clips and cut along a tube.

Two clips stay on the patient's side of the cut, the third goes with the gallbladder. Wanted are a gap of 2 mm
or more between clips, a cuff of 1 to 3 mm at the cut, and 5 mm to the common bile duct. On a short tube all
distances shrink alike, down to the least. A clip does not always close where it was meant to: the next clips
and the cut keep their distances from the clips as they lie. Sources: docs/how-to/clip-and-cut.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from schemas.errors import MotionError
from schemas.vectors import Vector

__all__ = [
    "CUFF",
    "FIRST",
    "LAST",
    "LEAST_LENGTH",
    "STAYS",
    "Places",
    "choose_places",
    "cut_window",
    "free_place",
    "further_place",
]

STAYS = 2
"""Clips that stay on the patient's side of the cut."""
_WANTED = np.array([3.5e-3, 3.0e-3, 3.0e-3, 4.0e-3, 5.6e-3])
"""Gallbladder to clip 3, to the cut, to clip 2, to clip 1, to the end of the tube; middles of clips, m."""
_LEAST = np.array([1.5e-3, 1.6e-3, 1.6e-3, 2.0e-3, 1.5e-3])
"""Least of these distances, m: room for half a jaw in soft tissue, cuffs of 1 mm, clips side by side."""
LEAST_LENGTH = float(_LEAST.sum())
"""Length of the shortest tube with room for three clips and the cut, m."""
FIRST, CUFF, APART, LAST = (float(_LEAST[number]) for number in (0, 1, 3, 4))
"""Least distance of a clip from the gallbladder, from the cut, from the next clip, from the tube's end, m."""
_GRID = 0.25e-3
"""Distance of the places that are tried for a further clip, m."""


class Places(NamedTuple):
    """Distances along a tube at rest, from the gallbladder's end, m."""

    clips: Vector
    """Clips 1 and 2, on the patient's side, and clip 3, shape (3,)."""
    cut: float
    is_roomy: bool
    """Whether there is room for all wanted distances."""

    def beside(self, closed: Vector) -> Vector:
        """Return the places of the clips moved aside from those that are closed, m, shape (3,).

        `closed`: places of the clips 1 to 3 as they lie, m; negative: not closed.
        """
        first, second, third = self.clips.tolist()
        if closed[1] >= 0.0:
            first = max(first, float(closed[1]) + APART)
        if closed[0] >= 0.0:
            second = min(second, float(closed[0]) - APART)
        if closed[1] >= 0.0:
            third = max(min(third, float(closed[1]) - 2.0 * CUFF), FIRST)
        return np.array([first, second, third])


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


def cut_window(clips: Vector) -> tuple[float, float] | None:
    """Return the piece of a tube to cut in, m: between clips, with cuffs and `STAYS` clips beyond.

    `clips`: places as they lie, m. None: no two clips leave room for a cut with its cuffs.
    """
    ordered = np.sort(clips)
    gaps = np.diff(ordered)[: max(0, len(ordered) - STAYS)] - 2.0 * CUFF
    if not gaps.size or gaps.max() < 0.0:
        return None
    widest = int(gaps.argmax())
    return float(ordered[widest]) + CUFF, float(ordered[widest + 1]) - CUFF


def free_place(begin: float, end: float, clips: Vector) -> float | None:
    """Return the place from `begin` to `end` (m) farthest from all clips; None: no room for a clip."""
    found = _free(begin, end, clips)
    return (
        float(found[np.abs(found[:, None] - clips).min(axis=1, initial=1.0).argmax()]) if found.size else None
    )


def further_place(length: float, clips: Vector) -> float | None:
    """Return the place of a further clip that makes a cut possible on a tube of `length`, m; None: none."""
    found: list[tuple[float, float, float]] = []
    for place in _free(FIRST, length - LAST, clips).tolist():
        window = cut_window(np.append(clips, place))
        if window is not None:
            nearest = float(np.abs(clips - place).min())
            found.append((round(window[1] - window[0], 6), nearest, place))
    return max(found)[2] if found else None


def _free(begin: float, end: float, clips: Vector) -> Vector:
    """Return the places between two ends (m) that keep their distance from all clips, shape (n,)."""
    places = np.arange(begin, end, _GRID)
    return places[(np.abs(places[:, None] - clips) >= APART).all(axis=1)]
