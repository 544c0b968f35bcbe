"""Places where a tube is parted: no piece of the organ goes on from one side to the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from schemas.vectors import Vector

__all__ = ["Parting", "find_partings", "without_crumbs"]

_NEXT = 2
"""Rings beyond a parting within which the next part begins: crumbs may lie between."""


class Parting(NamedTuple):
    """A gap all around a tube."""

    ring: int
    """Last ring on its left, a mean over the circumference."""
    along: float
    """Distance from the first ring along the line at rest, m."""


def find_partings(pieces: NDArray[np.int64], along: Vector) -> list[Parting]:
    """Return the partings of a tube from its left end to its right.

    pieces: piece of each node of the rings, -1 of a node that has gone, shape (r, a). along: place of the
    rings, m, shape (r,).
    """
    found: list[Parting] = []
    seen: list[int] = []
    last_ring, rows = len(pieces) - 1, np.arange(len(pieces))[:, None]
    part = _largest(pieces[0])
    while part >= 0 and not (pieces[last_ring] == part).any():
        seen.append(part)
        ends: NDArray[np.int64] = np.where(pieces == part, rows, -1).max(axis=0)
        ends = ends[ends >= 0]
        ring = int(ends.mean())
        if not found or ring > found[-1].ring:
            found.append(Parting(ring, float(0.5 * (along[ends] + along[ends + 1]).mean())))
        beyond = pieces[ring + 1 : int(ends.max()) + 1 + _NEXT]
        part = _largest(beyond[~np.isin(beyond, seen)])
    return found


def without_crumbs(pieces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the nodes of the rings in pieces as large as a ring: crumbs of a cut fall far away.

    pieces: as for `find_partings`.
    """
    counts = np.bincount(pieces[pieces >= 0], minlength=1)
    return (pieces >= 0) & (counts[pieces] >= pieces.shape[1])


def _largest(pieces: NDArray[np.int64]) -> int:
    """Return the piece with the most nodes, -1: there is none."""
    present = pieces[pieces >= 0]
    return int(np.bincount(present).argmax()) if present.size else -1
