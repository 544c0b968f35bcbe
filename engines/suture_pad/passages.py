"""A thread in its channels, held by friction. No ports, no bonds. SI units.

A passage is a channel entered by the needle's base: a row of points in the tissue, of length L from mouth to
end. The thread inside lies on the row, so a single number is its whole state: b, the length of thread fed
into the mouth. The thread does not stretch, so the pull is geometry alone:

    newest passage     b >= L + distance from the end to the needle's base, or the base's own distance inside
    earlier passage    b >= L + distance from the end to the mouth of the next + b of the next

Friction is a spring per length slipping at its largest force (Prandtl). A passage without pull returns to the
rest of its spring; a pulled passage adds its friction to the force on the needle's base. So the force is the
gradient of the springs' energy and can only lose energy; there is no mass, and no step is too long.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

import numpy as np

from engines.suture_pad.tissue import TissueParams
from hub.participant import Record, array, integer
from robots.training.threads import ThreadParams
from schemas.vectors import Vector

__all__ = ["MOST", "Passage", "Passages", "PassagesState"]

MOST = 8
"""Most passages: stitches made with a thread. Further passages have no friction."""
_LONGEST = 40
"""Most points of a passage."""
_STILL = np.zeros(3)


class PassagesState(Record):
    """All passages in the order of opening; entries beyond `count` are zero."""

    count = integer()
    points = array(MOST, _LONGEST, 3)
    """m, frame `pad`."""
    counts = array(MOST)
    """Numbers of points."""
    through = array(MOST)
    """Length of thread fed into the mouth, m."""
    slid = array(MOST)
    """Length of thread without friction, m."""


class Passage(NamedTuple):
    """A channel with thread inside."""

    points: Vector
    """Points from mouth to end, m, shape (n, 3)."""
    ways: Vector
    """Distances of the points from the mouth, along the passage, m, shape (n,)."""
    through: float
    """Length of thread fed into the mouth, m."""

    @property
    def length(self) -> float:
        """From mouth to end, m."""
        return float(self.ways[-1])

    def at(self, ways: Vector) -> Vector:
        """Return the places at these distances (m) from the mouth, shape (n, 3), straight on outside."""
        inside = np.clip(ways, 0.0, self.length)
        places = np.stack([np.interp(inside, self.ways, self.points[:, axis]) for axis in range(3)], axis=1)
        before, behind = np.minimum(ways - inside, 0.0), np.maximum(ways - inside, 0.0)
        first, last = (self.points[at + 1] - self.points[at] for at in (0, -2))
        places += before[:, None] * first / max(float(np.linalg.norm(first)), 1e-12)
        places += behind[:, None] * last / max(float(np.linalg.norm(last)), 1e-12)
        return places


class Passages:
    """A thread and its channels in a pad."""

    def __init__(self, thread: ThreadParams, tissue: TissueParams) -> None:
        self._total, self._friction = thread.length, tissue.thread_friction
        self._stiffness = tissue.thread_friction / tissue.give
        self.state = PassagesState()
        self.pull = 0.0
        """Size of the force on the needle's base, N."""
        self.refresh()

    def open(self, points: Vector, through: float) -> None:
        """Begin a passage along a row of points (m), shape (n, 3), with a length of thread inside (m)."""
        state = self.state
        at, points = state.count, points[:_LONGEST]
        state.points[at, : len(points)], state.counts[at] = points, len(points)
        state.through[at] = state.slid[at] = through
        state.count = at + 1
        self.refresh()

    @property
    def is_full(self) -> bool:
        """Whether no further passage can be opened."""
        return self.state.count == MOST

    def refresh(self) -> None:
        """Measure all passages of the state."""
        state = self.state
        rows = [state.points[at, : int(state.counts[at])] for at in range(state.count)]
        self._rows = [
            (row, np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(row, axis=0), axis=1))]))
            for row in rows
        ]
        self._lengths = [float(ways[-1]) for _, ways in self._rows]
        self._ends: list[list[float]] = [row[-1].tolist() for row in rows]
        self._gaps = [float(np.linalg.norm(later[0] - row[-1])) for row, later in pairwise(rows)]

    def __iter__(self) -> Iterator[Passage]:
        """Yield the passages from the newest on."""
        for at in reversed(range(self.state.count)):
            yield Passage(*self._rows[at], float(self.state.through[at]))

    def advance(self, base: Vector, forward: Vector, inserted: float | None) -> Vector:
        """Follow the needle's base, and return the force on the base, N, frame `pad`.

        Args:
            base: base of the needle, m, frame `pad`.
            forward: unit vector from the base into the needle, frame `pad`.
            inserted: depth of the base in the newest passage, m; None: outside.
        """
        newest = self.state.count - 1
        self.pull = 0.0
        if newest < 0:
            return _STILL
        if inserted is not None:
            self.pull = self._slide_thread(inserted, is_led=True)
            force: Vector = -self.pull * forward
        else:
            x, y, z = base.tolist()
            u, v, w = self._ends[newest]
            u, v, w = u - x, v - y, w - z
            gap = sqrt(u * u + v * v + w * w)
            self.pull = self._slide_thread(self._lengths[newest] + gap, is_led=False)
            scale = self.pull / max(gap, 1e-9)
            force = np.array([scale * u, scale * v, scale * w])
        self._forget(inserted)
        return force

    def _slide_thread(self, demand: float, *, is_led: bool) -> float:
        """Pull the newest passage to `demand` (m), then the earlier passages; return the sum of friction, N.

        `is_led`: the needle itself is in the newest passage, and pushes the thread back, too.
        """
        pull, total, is_taut = 0.0, self._total, True
        through, slid = self.state.through, self.state.slid
        for at in reversed(range(self.state.count)):
            rest, length = float(slid[at]), self._lengths[at]
            way = demand if is_led else max(rest, demand)
            is_taut, is_led = is_taut and (is_led or demand > rest), False
            stretch = way - rest
            rub = max(-self._friction, min(self._friction, self._stiffness * stretch))
            through[at], slid[at] = way, way - rub / self._stiffness
            if is_taut:
                pull += rub * max(0.0, min(way, length) - max(0.0, way - total))
            if at:
                demand = way + self._gaps[at - 1] + self._lengths[at - 1]
        return pull

    def _forget(self, inserted: float | None) -> None:
        """Forget the newest passage if the needle has left by the mouth, and the oldest without thread."""
        state = self.state
        if inserted is not None and inserted <= 0.0:
            state.count -= 1
            self._clear_passage(state.count)
        elif float(state.through[0]) >= self._total + self._lengths[0]:
            for kept in (state.points, state.counts, state.through, state.slid):
                kept[:-1] = kept[1:].copy()
            state.count -= 1
            self._clear_passage(state.count)

    def _clear_passage(self, at: int) -> None:
        state = self.state
        state.points[at] = state.counts[at] = state.through[at] = state.slid[at] = 0.0
        self.refresh()
