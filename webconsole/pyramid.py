"""A pyramid of least and greatest values: any stretch of a long series in as many rows as a plot needs."""

from __future__ import annotations

import numpy as np

from schemas.vectors import Vector

__all__ = ["Pyramid"]

_GROUP = 8
"""Rows of a level per row of the next level."""
_SHORTEST = 1024
"""Rows of a level without a next level."""


class Pyramid:
    """Levels of a series, each with least and greatest value of groups of the level before.

    A stretch is read from the coarsest level of enough resolution: the cost depends on the number of rows
    asked for, not on the length of the series.

    Args:
        times: Shape (n,), s, not decreasing.
        values: Shape (n, columns).
    """

    def __init__(self, times: Vector, values: Vector) -> None:
        self._levels = [(times, values, values)]
        while len(times) > _SHORTEST:
            edges = np.arange(0, len(times), _GROUP)
            times, low, high = self._levels[-1]
            times = times[edges]
            low, high = np.fmin.reduceat(low, edges), np.fmax.reduceat(high, edges)
            self._levels.append((times, low, high))

    def rows(self, start_s: float, end_s: float, buckets: int) -> Vector:
        """Return rows of time and values between two times, shape (n, 1 + columns).

        Of more values than two for each bucket, the least and the greatest of each column in each bucket are
        kept, so that no peak is lost. A row before and a row behind are added: lines go on beyond a plot.
        """
        spans = [
            (
                max(0, int(np.searchsorted(times, start_s, "right")) - 1),
                min(len(times), int(np.searchsorted(times, end_s)) + 1),
            )
            for times, _, _ in self._levels
        ]
        level = max((i for i, (first, last) in enumerate(spans) if last - first > 2 * buckets), default=0)
        times, low, high = (part[slice(*spans[level])] for part in self._levels[level])
        if len(times) <= 2 * buckets:
            return np.column_stack([times, low])
        edges = np.linspace(0, len(times), buckets + 1).astype(np.int64)[:-1]
        rows = np.empty((2 * buckets, 1 + low.shape[1]))
        rows[0::2, 0], rows[1::2, 0] = times[edges], times[(edges + np.append(edges[1:], len(times))) // 2]
        rows[0::2, 1:], rows[1::2, 1:] = np.fmin.reduceat(low, edges), np.fmax.reduceat(high, edges)
        return rows
