"""A thread in the channels that it was drawn through: what holds it there. No ports, no bonds. SI units.

A passage is a channel that the needle's base has gone into: a row of points in the tissue, and the length b
of thread that has gone into it. At the point a metres from its mouth is then the point of the thread b - a
behind the needle's base. As of the needle (`channel`), what lies between the two, d, is split along the
channel's tangent t:

    along:       b grows by the mean of t . d over the passage; friction is a spring that slips (Prandtl)
    across:      K ds (d - t (t . d)) on the thread: K times the area swept

The thread is straight between its nodes, so a force goes to the two nodes beside by their shares.
"""

from __future__ import annotations

import numpy as np

from engines.suture_pad.tissue import TissueParams
from hub.participant import Record, array
from robots.training.threads import ThreadParams
from schemas.vectors import Vector

__all__ = ["APART", "MOST", "Passages", "PassagesState"]

MOST = 8
"""Of passages: as many stitches as one thread is drawn through. More are not held."""
APART = 1.0e-3
"""Between the points of a passage, m."""
_LONGEST = 40
"""Of points of a passage; a channel that is longer is held at its mouth's end only, by so many."""


class PassagesState(Record):
    """All passages; those beyond the last that was opened are zero."""

    points = array(MOST, _LONGEST, 3)
    """m, frame `pad`."""
    counts = array(MOST)
    """Of points; 0: no passage, or the thread has left it."""
    through = array(MOST)
    """Length of thread that has gone into the mouth, m."""
    slid = array(MOST)
    """What that would have to be for no friction, m."""


class Passages:
    """One thread, and the channels of one pad that it runs through."""

    def __init__(self, thread: ThreadParams, tissue: TissueParams) -> None:
        self._thread, self._tissue = thread, tissue
        self.state = PassagesState()
        self.refresh()

    def open(self, points: Vector, through: float) -> None:
        """Begin a passage along a channel's points (m, `APART`), shape (n, 3), with so much thread in it."""
        state = self.state
        if not (state.counts == 0.0).any():
            return
        at = int((state.counts == 0.0).argmax())
        points = points[:_LONGEST]
        state.points[at, : len(points)], state.counts[at] = points, len(points)
        state.through[at] = state.slid[at] = through
        self.refresh()

    def refresh(self) -> None:
        """Take the rows of all passages, one after the other, from the state."""
        counts = self.state.counts.astype(int)
        self._which = np.repeat(np.arange(MOST), counts)
        self._arclengths = APART * np.concatenate([np.arange(0.0), *map(np.arange, counts.tolist())])
        self._points: Vector = np.concatenate(
            [self.state.points[at, :count] for at, count in enumerate(counts.tolist())]
        )
        self._tangents: Vector = np.concatenate(
            [_tangents(self.state.points[at, :count]) for at, count in enumerate(counts.tolist())]
        )

    def advance(self, line: Vector) -> Vector:
        """Follow the thread, and return the forces (N) on its nodes, shape (n + 1, 3), frame `pad`.

        Args:
            line: base of the needle and nodes of the thread, m, frame `pad`, shape (n + 1, 3).
        """
        forces = np.zeros_like(line)
        if not len(self._which):
            return forces
        state, tissue, which = self.state, self._tissue, self._which
        behind = state.through[which] - self._arclengths
        weights = np.clip(behind / APART + 0.5, 0.0, 1.0)
        weights *= np.clip((self._thread.length - behind) / APART + 0.5, 0.0, 1.0)
        nodes = np.clip(behind / self._thread.segment, 0.0, self._thread.segments)
        before = np.minimum(nodes.astype(int), self._thread.segments - 1)
        share = (nodes - before)[:, None]
        away = (1.0 - share) * line[before] + share * line[before + 1] - self._points
        along = (away * self._tangents).sum(axis=1)
        covered: Vector = np.bincount(which, weights, MOST).astype(np.float64)
        moved = np.bincount(which, weights * along, MOST)
        state.through += np.divide(moved, covered, out=np.zeros(MOST), where=covered > 0.0)
        pull = self._rub()[which, None] * self._tangents
        across = away - along[:, None] * self._tangents
        loads = -APART * weights[:, None] * (tissue.compression * across + pull)
        np.add.at(forces, before, (1.0 - share) * loads)
        np.add.at(forces, before + 1, share * loads)
        self._close(covered)
        return forces

    def _rub(self) -> Vector:
        """Return the friction of each passage, N/m; let the thread slip where it is too large."""
        state, largest = self.state, self._tissue.thread_friction
        stiffness = largest / self._tissue.give
        pull = np.clip(stiffness * (state.through - state.slid), -largest, largest)
        state.slid[:] = state.through - pull / stiffness
        return pull

    def _close(self, covered: Vector) -> None:
        """Forget the passages in which there is no thread any more."""
        left = (covered == 0.0) & (self.state.counts > 0.0)
        if left.any():
            self.state.counts[left] = self.state.through[left] = self.state.slid[left] = 0.0
            self.state.points[left] = 0.0
            self.refresh()


def _tangents(points: Vector) -> Vector:
    """Return unit vectors along a row of points, shape (n, 3), from its mouth on."""
    if len(points) < 2:
        return np.zeros((len(points), 3))
    ways = np.gradient(points, axis=0)
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)
