"""Quality of stitches: places of entry and exit, depth, and load of the tissue."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.instant import Instant
from tasks.metrics.metric import Metric, missing

__all__ = ["Stitches", "TissueSeen"]


class TissueSeen:
    """Reports of the tissue at an instant."""

    def __init__(self) -> None:
        self.is_known = False
        """Whether any report is connected."""
        self.depth = self.force = self.trauma = 0.0
        """m, N, m^2."""
        self.entry, self.exit = np.zeros(3), np.zeros(3)
        """Where the needle went in and out last, m, in the world."""


class StitchesState(Record):
    """Sums over all stitches."""

    errors = array(2)
    """Sum of the distances of entries and of exits from their holes, m."""
    largest = array(2)
    counts = array(2)
    missed = integer()
    """Number of entries and exits away from all holes."""
    made = integer()
    withdrawn = integer()
    depth = number()
    force = number()
    trauma = number()
    swept = number()
    """Integral of the area between needle and channel over time, m^2 s."""
    inside = number()
    """Time with the needle in tissue, s."""
    is_inside = number()


class Stitches(Metric[StitchesState]):
    """Accuracy, depth, force and trauma."""

    def __init__(self, tissue: TissueSeen, holes: Vector) -> None:
        """`tissue`: reports of the tissue; `holes`: places of the holes, m, shape (n, 3), in the world."""
        self.state = StitchesState()
        self._tissue, self._holes = tissue, holes

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Follow tissue and events."""
        state, tissue = self.state, self._tissue
        for event in events:
            if event.kind in ("entered", "exited"):
                self._mark_hole(event, tissue.entry if event.kind == "entered" else tissue.exit)
            state.made += event.kind == "stitched"
            state.withdrawn += event.kind == "withdrawn"
            if event.kind in ("entered", "stitched", "withdrawn"):
                state.is_inside = float(event.kind == "entered")
        state.depth, state.force = max(state.depth, tissue.depth), max(state.force, tissue.force)
        state.trauma = max(state.trauma, tissue.trauma)
        state.swept += tissue.trauma * now.period_s
        state.inside += state.is_inside * now.period_s

    def _mark_hole(self, event: Event, at: Vector) -> None:
        state, side = self.state, int(event.kind == "exited")
        if event.place < 0:
            state.missed += 1
            return
        off = at - self._holes[event.place]
        error = float(np.sqrt(off @ off))
        state.errors[side] += error
        state.counts[side] += 1.0
        state.largest[side] = max(state.largest[side], error)

    def values(self) -> Iterator[ScoreValue]:
        """Yield the numbers; null where the tissue is not connected."""
        state = self.state
        units = {"made": "", "missed": "", "withdrawn": ""}
        units |= {"depth": "m", "force": "N", "trauma": "m^2", "swept": "m^2*s", "inside": "s"}
        for name, unit in units.items():
            if self._tissue.is_known:
                yield ScoreValue(name=f"stitches/{name}", value=float(getattr(state, name)), unit=unit)
            else:
                yield missing(f"stitches/{name}", unit, "the tissue is not known: connect pad.* to tissue/*")
        for side, name in enumerate(("entry", "exit")):
            for what, sums in (("mean", state.errors), ("largest", state.largest)):
                full = f"stitches/{name}_error_{what}"
                if count := state.counts[side]:
                    value = float(sums[side] / count if what == "mean" else sums[side])
                    yield ScoreValue(name=full, value=value, unit="m")
                else:
                    yield missing(full, "m", f"no {name} at any hole")
