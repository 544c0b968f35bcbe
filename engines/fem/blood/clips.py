"""The clips on a tube: what they shut, what pulls them off, and where they are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.fem.blood.lumen import Lumen
from engines.fem.organ import Organ
from engines.tissue.probes.clip import ClipParams
from schemas.vectors import Vector

__all__ = ["MOST_CLIPS", "ClipBody", "Clips", "ClosedClip", "Lost"]

MOST_CLIPS = 32
"""Most clips of a tube since time 0."""
_ON, _RING, _FIRST, _LAST, _SECTOR, _LENGTH, _WIDTH, _ALONG, _ACROSS, _PROBE = range(10)


class Lost(NamedTuple):
    """A clip that has come off."""

    number: int
    ring: int
    instrument: str
    """Probe that pulled."""
    place: Vector
    """m, in `world`, shape (3,)."""
    force: float
    """Pull just before, N."""


class ClosedClip(NamedTuple):
    """A clip since it was closed."""

    number: int
    ring: int
    instrument: str
    """Probe that closed the clip."""
    is_on: bool


class ClipBody(NamedTuple):
    """A closed clip as it is seen."""

    number: int
    middle: Vector
    """m, in `world`, shape (3,)."""
    axes: Vector
    """Along its legs, along the tube, and from leg to leg, a column each, shape (3, 3)."""
    length: float
    """Length of the legs, m."""
    width: float
    """Width of the legs along the tube, m."""
    wall: float
    """Thickness of the wall under each leg, m."""


class Clips:
    """Clips by number, each with the ties of its rings."""

    def __init__(self, organ: Organ, lumen: Lumen, room: int) -> None:
        """`room`: for ties."""
        self._organ, self._lumen = organ, lumen
        self._rows: Vector = np.zeros((MOST_CLIPS, 10))
        self._clip_of: NDArray[np.int64] = np.full(room, -1)
        """Clip of each tie, shape (room,)."""

    def put(self, ring: int, closing: Vector, params: ClipParams, instrument: str) -> int:
        """Shut the rings within half a clip's width of a ring, along `closing`.

        Return the number of the clip; -1: no clip is left.
        """
        free = np.flatnonzero(self._rows[:, _LENGTH] == 0.0)
        if not free.size:
            return -1
        first, last = self._lumen.rings_near(ring, 0.5 * params.width)
        sector, number = self._lumen.sector_towards(ring, closing), int(free[0])
        fresh = [one for one in range(first, last + 1) if not self._lumen.shut[one]]
        pairs = [self._lumen.opposite(one, self._lumen.sector_towards(one, closing)) for one in fresh]
        if pairs:
            begun = int((self._clip_of >= 0).sum())
            tied = np.concatenate(pairs)
            self._organ.solid.tie(tied)
            self._clip_of[begun : begun + len(tied)] = number
        shape = params.length, params.width, params.hold_along, params.hold_across
        probe = self._organ.probes.index(instrument)
        self._rows[number] = 1.0, ring, first, last, sector, *shape, probe
        self._shut()
        return number

    def watch(self) -> list[Lost]:
        """Take off the clips that instruments pull at too hard, and return them.

        The pull is the force of the tissue on the nodes under a clip: at rest that of what holds them.
        """
        if not self._rows[:, _ON].any() or not self._organ.held.any():
            return []
        lost: list[Lost] = []
        for number in np.flatnonzero(self._rows[:, _ON]).tolist():
            nodes = np.unique(self._organ.solid.ties[self._clip_of == number])
            if not self._organ.held[nodes].any():
                continue
            row, ring = self._rows[number], int(self._rows[number, _RING])
            pull: Vector = self._organ.solid.force[nodes, :3].astype(np.float64).sum(axis=0)
            along = float((pull * self._lumen.frame_at(ring, int(row[_SECTOR]))[:, 1]).sum())
            whole = float((pull * pull).sum())
            across = max(0.0, whole - along * along)
            if (along / row[_ALONG]) ** 2 + across / row[_ACROSS] ** 2 > 1.0:
                holders = self._organ.solid.holder[nodes]
                holder = self._organ.probe_of(int(holders[holders >= 0][0]))
                self._take_off(number)
                lost.append(Lost(number, ring, holder, self._lumen.middles[ring], float(np.sqrt(whole))))
        return lost

    def _take_off(self, number: int) -> None:
        kept = np.flatnonzero((self._clip_of >= 0) & (self._clip_of != number))
        ties, clips = self._organ.solid.ties[kept].copy(), self._clip_of[kept].copy()
        self._organ.solid.untie()
        self._organ.solid.tie(ties)
        self._clip_of[:] = -1
        self._clip_of[: len(clips)] = clips
        self._rows[number, _ON] = 0.0
        self._shut()

    def _shut(self) -> None:
        self._lumen.shut[:] = False
        for row in self._rows[self._rows[:, _ON] > 0.0].astype(np.int64):
            self._lumen.shut[row[_FIRST] : row[_LAST] + 1] = True

    @property
    def closed(self) -> list[ClosedClip]:
        """All clips since time 0, in the order of closing."""
        rows = self._rows[self._rows[:, _LENGTH] > 0.0]
        return [
            ClosedClip(number, int(row[_RING]), self._organ.probes[int(row[_PROBE])], bool(row[_ON]))
            for number, row in enumerate(rows)
        ]

    @property
    def bodies(self) -> list[ClipBody]:
        """The clips as they are seen."""
        return [self._body(number) for number in np.flatnonzero(self._rows[:, _ON]).tolist()]

    def _body(self, number: int) -> ClipBody:
        row = self._rows[number]
        ring = int(row[_RING])
        axes = self._lumen.frame_at(ring, int(row[_SECTOR]))
        shape = float(row[_LENGTH]), float(row[_WIDTH]), float(self._lumen.walls[ring])
        return ClipBody(number, self._lumen.middles[ring], axes, *shape)

    @property
    def state(self) -> tuple[NDArray[np.generic], ...]:
        """Arrays that the next step depends on."""
        return self._rows, self._clip_of

    def restore(self, rows: NDArray[np.generic], clip_of: NDArray[np.generic]) -> None:
        """Go back to a saved `state`."""
        self._rows[:], self._clip_of[:] = rows.reshape(self._rows.shape), clip_of
        self._shut()
