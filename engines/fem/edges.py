"""Sharp edges between spheres, and how far each has cut into a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engines.fem.arrays import aligned_integers
from schemas.vectors import Vector

__all__ = ["NO_EDGES", "Edges"]


class Edges:
    """Edges of blades in one body, and their state: `_blade.c` moves it."""

    def __init__(self, ends: Sequence[tuple[int, int]], samples: int, toughness: float) -> None:
        """Start outside the body.

        Args:
            ends: the spheres at the ends of each edge.
            samples: points along an edge, at most 64.
            toughness: work per area of cut, J/m^2.
        """
        n = len(ends)
        self.ends: NDArray[np.int32] = aligned_integers(np.array(ends, np.int64).reshape(-1, 2))
        self.toughness = toughness
        self.element: NDArray[np.int32] = aligned_integers(np.full((n, samples), -1))
        """Element with the front of a sample's cut; negative: none, shape (n, samples)."""
        self.front: Vector = np.zeros((n, samples, 3))
        """Front of the cut in the resting body, m, shape (n, samples, 3)."""
        self.ahead: Vector = np.zeros((n, samples, 3))
        """Direction of its advance, shape (n, samples, 3)."""
        self.swept: Vector = np.zeros(1)
        """Area that has been cut, m^2."""

    @property
    def area(self) -> float:
        """Area that has been cut, m^2: times `toughness`, the work of cutting."""
        return float(self.swept[0])

    @property
    def state(self) -> tuple[NDArray[np.generic], ...]:
        """Arrays that change."""
        return self.element, self.front, self.ahead, self.swept


NO_EDGES = Edges((), 0, 1.0)
