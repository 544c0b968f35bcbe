"""The values of a bond of a running session that the server has seen, for force against depth."""

from __future__ import annotations

from threading import Lock

import numpy as np

from hub.recording.bond_trace import BondTrace
from schemas.vectors import Vector

__all__ = ["BondHistory"]

_MOST = 8192
"""Values of a side; of more, each second is dropped."""
_GAP_S = 0.5
"""Shortest time without a value, s, after which a contact has no known beginning: no page was open, say.
The values of a fast session are further apart, so five times the time between the values before counts, too.
"""


class BondHistory:
    """Places and forces of a bond at one point, each at its own times; from any thread."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._places, self._forces = _History(), _History()
        self._lock = Lock()

    def add_place(self, time_s: float, place: Vector) -> None:
        """Add a place, m, shape (3,) or longer; one known already is ignored."""
        with self._lock:
            self._places.add(time_s, place[:3])

    def add_force(self, time_s: float, force: Vector) -> None:
        """Add a force, N, shape (3,) or longer; one known already is ignored."""
        with self._lock:
            self._forces.add(time_s, force[:3])

    @property
    def trace(self) -> BondTrace:
        """The trace of the bond."""
        with self._lock:
            places, forces = self._places.columns(), self._forces.columns(with_missing=True)
        return BondTrace.of_series(self._name, *places, *forces)


class _History:
    """Rows of a time and a vector; a row of NaN says that the values before the next row are missing."""

    def __init__(self) -> None:
        self._rows, self._count = np.empty((_MOST, 4)), 0
        self._last_s, self._since_s = 0.0, 0.0

    def add(self, time_s: float, vector: Vector) -> None:
        """Add a row, if it is new."""
        if self._count and time_s <= self._last_s:
            return
        since_s = time_s - self._last_s
        if since_s > _GAP_S and (not self._count or since_s > 5.0 * self._since_s > 0.0):
            self._append(np.array([time_s - 0.5 * since_s, np.nan, np.nan, np.nan]))
        elif self._count:
            self._since_s = since_s
        self._append(np.concatenate([[time_s], vector]))
        self._last_s = time_s

    def _append(self, row: Vector) -> None:
        if self._count == _MOST:
            kept = np.isnan(self._rows[:, 1]) | (np.arange(_MOST) % 2 == 1)
            self._count = int(kept.sum())
            self._rows[: self._count] = self._rows[kept]
        self._rows[self._count] = row
        self._count += 1

    def columns(self, *, with_missing: bool = False) -> tuple[Vector, Vector]:
        """Return times, s, shape (n,), and vectors, shape (n, 3)."""
        table = self._rows[: self._count]
        if not with_missing:
            table = table[~np.isnan(table[:, 1])]
        return table[:, 0], table[:, 1:]
