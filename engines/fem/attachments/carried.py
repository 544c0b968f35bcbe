"""Pieces of organs that an anchor or a grasp carries, or another such piece that they are tied to."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from engines.fem.organ import Organ
from engines.tissue.meshing.tet_mesh import Indices

__all__ = ["carried_pieces"]


def carried_pieces(organs: Sequence[Organ], ends: NDArray[np.integer]) -> list[Indices]:
    """Return the carried pieces of each organ.

    `ends`: of each whole tie the first organ, its element, the second organ and its element, shape (t, 4).
    """
    pieces = [organ.solid.pieces for organ in organs]
    begins = np.cumsum([0, *(int(labels.max(initial=-1)) + 1 for labels in pieces)])
    carried = np.zeros(begins[-1], np.bool_)
    tied = np.full((len(ends), 2), -1, np.int64)
    """Numbers of the pieces among those of all organs; -1: an element that has gone."""
    for i, organ in enumerate(organs):
        carried[begins[i] + organ.held_pieces(pieces[i])] = True
        for side in (0, 1):
            own = ends[:, 2 * side] == i
            labels = pieces[i][ends[own, 2 * side + 1]]
            tied[own, side] = np.where(labels < 0, -1, begins[i] + labels)
    tied = tied[(tied >= 0).all(axis=1)]
    while True:
        either = tied[carried[tied].any(axis=1)]
        if carried[either].all():
            return [np.flatnonzero(carried[a:b]) for a, b in pairwise(begins)]
        carried[either] = True
