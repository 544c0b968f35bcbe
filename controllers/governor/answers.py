"""The answers of a policy under execution: goals by time."""

from __future__ import annotations

from typing import Literal

import numpy as np

from schemas.vectors import Vector

__all__ = ["Answers"]

_DECAY = 0.01
"""Weights exp(-0.01 i) of temporal ensembling, the oldest answer first (ACT: Zhao et al., RSS 2023)."""
_MOST_KEPT = 16


class Answers:
    """Goals of the newest answers, of `arms` arms with `size` numbers each."""

    def __init__(
        self,
        arms: int,
        size: int,
        horizon: int,
        row_ns: int,
        execution: Literal["receding-horizon", "temporal-ensembling"],
        execute: int,
    ) -> None:
        """Begin without an answer; `execute`: rows between two observations."""
        kept = 1 if execution == "receding-horizon" else min(-(-horizon // execute), _MOST_KEPT)
        self._row_ns, self._turns = row_ns, slice(3, 7) if size == 8 else None
        self._goals = np.zeros((kept, horizon, arms, size))
        self._times = np.zeros((kept, 2))
        """Instant of the observation, ns, and number of rows; no rows: no answer. The newest is first."""
        self.state = (self._goals, self._times)

    def add(self, start_ns: int, goals: Vector) -> None:
        """Add an answer to the observation at `start_ns`: goals, shape (rows, arms, size)."""
        self._goals[:] = np.roll(self._goals, 1, axis=0)
        self._times[:] = np.roll(self._times, 1, axis=0)
        self._goals[0, : len(goals)] = goals
        self._times[0] = start_ns, len(goals)

    def forget(self) -> None:
        """Forget all answers."""
        self._goals[:], self._times[:] = 0.0, 0.0

    @property
    def end_ns(self) -> int:
        """Instant of the newest answer's last row; 0 without an answer."""
        start, rows = self._times[0].tolist()
        return int(start + rows * self._row_ns) if rows else 0

    def distance(self, start_ns: int, goals: Vector) -> float:
        """Return the largest distance (m) between tips of this answer and of the newest, at one instant.

        0 where no instant is in both, or goals are joint positions.
        """
        start, rows = self._times[0].tolist()
        if not rows or self._turns is None:
            return 0.0
        largest = 0.0
        for row, goal in enumerate(goals, 1):
            then = start_ns + row * self._row_ns
            if then <= start + rows * self._row_ns:
                apart = np.linalg.norm(goal[:, :3] - self._at(0, then)[:, :3], axis=1)
                largest = max(largest, float(apart.max()))
        return largest

    def goal(self, now_ns: int) -> Vector | None:
        """Return the goals at an instant, shape (arms, size); None without an answer.

        After its last row the newest answer keeps it.
        """
        if not self._times[0, 1]:
            return None
        ends = self._times[:, 0] + self._times[:, 1] * self._row_ns
        live = [i for i in range(len(ends)) if self._times[i, 1] and now_ns <= ends[i]]
        if len(live) < 2:
            return self._at(0, now_ns)
        weights = np.exp(-_DECAY * np.arange(len(live)))[::-1]
        goals = np.array([self._at(i, now_ns) for i in live])
        if self._turns is not None:
            _align(goals[0, :, self._turns], goals[1:, :, self._turns])
        mean: Vector = np.einsum("i,ijk->jk", weights / weights.sum(), goals)
        return self._normalise(mean)

    def _at(self, answer: int, now_ns: float) -> Vector:
        """Return the goals of one answer, on the straight line between its rows, shape (arms, size)."""
        start, rows = self._times[answer].tolist()
        place = min(max((now_ns - start) / self._row_ns - 1.0, 0.0), rows - 1.0)
        first = int(place)
        if (share := place - first) == 0.0:
            return self._goals[answer, first].copy()
        one, other = self._goals[answer, first], self._goals[answer, first + 1].copy()
        if self._turns is not None:
            _align(one[:, self._turns], other[None, :, self._turns])
        return self._normalise(one + share * (other - one))

    def _normalise(self, goals: Vector) -> Vector:
        if self._turns is not None:
            goals[:, self._turns] /= np.linalg.norm(goals[:, self._turns], axis=1, keepdims=True)
        return goals


def _align(one: Vector, others: Vector) -> None:
    """Bring quaternions, shape (n, arms, 4), into the half of the sphere of `one`, shape (arms, 4)."""
    others *= np.where(np.sum(one * others, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
