"""Sharp edges between spheres, and how far each has cut into a body."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.fem.arrays import aligned_integers
from schemas.vectors import Vector

__all__ = ["NO_EDGES", "Edges", "Scissors", "closing_rates"]

_MOVING = 0.02
"""Least rate at which scissors open or close, rad/s: above the trembling of jaws that are held."""
_ABSENT = -1.0
"""Toughness for an edge that passes through."""


class Scissors(NamedTuple):
    """A pair of edges that turn about a hinge."""

    left: int
    """Number of the edge, from the hinge to its end."""
    right: int
    hinge: int
    """Number of a sphere on the hinge, on the side from where the left edge closes clockwise."""


class Edges:
    """Edges of blades in one body, and their state: `_blade.c` moves it."""

    def __init__(
        self,
        ends: Sequence[tuple[int, int]],
        samples: int,
        toughness: float,
        scissors: Sequence[Scissors] = (),
    ) -> None:
        """Start outside the body.

        Args:
            ends: the spheres at the ends of each edge.
            samples: points along an edge, at most 64.
            toughness: work per area of cut, J/m^2.
            scissors: pairs of edges that cut while they close on each other, and press while they are still.
        """
        n = len(ends)
        self._tissue, self._scissors = toughness, scissors
        self.ends: NDArray[np.int32] = aligned_integers(np.array(ends, np.int64).reshape(-1, 2))
        self.toughness: Vector = np.full(n, toughness)
        """Work per area of cut by each edge now, J/m^2, shape (n,).

        Infinite: the edge is blunt; negative: the edge passes through.
        """
        self.element: NDArray[np.int32] = aligned_integers(np.full((n, samples), -1))
        """Element with the front of a sample's cut; negative: none, shape (n, samples)."""
        self.front: Vector = np.zeros((n, samples, 3))
        """Front of the cut in the resting body, m, shape (n, samples, 3)."""
        self.ahead: Vector = np.zeros((n, samples, 3))
        """Direction of its advance, shape (n, samples, 3)."""
        self.swept: Vector = np.zeros(1)
        """Area that has been cut, m^2."""

    def sharpen(self, closing: Sequence[float]) -> None:
        """Let scissors cut if they close, press if still, and leave if they open.

        closing: rate of each pair from `closing_rates`.
        """
        for pair, rate in zip(self._scissors, closing, strict=False):  # NO_EDGES: none
            now = self._tissue if rate > _MOVING else _ABSENT if rate < -_MOVING else np.inf
            self.toughness[[pair.left, pair.right]] = now

    @property
    def sharp(self) -> NDArray[np.bool_]:
        """Edges that cut now, shape (n,)."""
        return np.isfinite(self.toughness) & (self.toughness > 0.0)

    @property
    def area(self) -> float:
        """Area that has been cut, m^2: times `toughness`, the work of cutting."""
        return float(self.swept[0])

    @property
    def state(self) -> tuple[NDArray[np.generic], ...]:
        """Arrays that change."""
        return self.element, self.front, self.ahead, self.swept


def closing_rates(
    scissors: Sequence[Scissors],
    ends: Sequence[tuple[int, int]],
    start: Vector,
    end: Vector,
    seconds: float,
) -> list[float]:
    """Return the rate at which the sine of the angle between the edges of each pair falls, 1/s.

    ends: the spheres at the ends of each edge. start, end: centres of the spheres, m, shapes (k, 3),
    `seconds` apart.
    """
    return [(_opening(pair, ends, start) - _opening(pair, ends, end)) / seconds for pair in scissors]


def _opening(pair: Scissors, ends: Sequence[tuple[int, int]], centres: Vector) -> float:
    """Return the sine of the angle between a pair of edges, negative once they have passed each other."""
    numbers = [*ends[pair.left], *ends[pair.right], pair.hinge]
    left, left_end, right, right_end, hinge = centres.take(numbers, axis=0).tolist()
    u = [end - start for start, end in zip(left, left_end, strict=True)]
    v = [end - start for start, end in zip(right, right_end, strict=True)]
    axis = [at - 0.5 * (one + other) for at, one, other in zip(hinge, left, right, strict=True)]
    normal = (v[1] * u[2] - v[2] * u[1], v[2] * u[0] - v[0] * u[2], v[0] * u[1] - v[1] * u[0])
    size = sqrt(_dot(u, u) * _dot(v, v))
    return copysign(sqrt(_dot(normal, normal)) / size, _dot(normal, axis)) if size else 0.0


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return 0.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


NO_EDGES = Edges((), 0, 1.0)
