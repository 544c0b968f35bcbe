"""The next job by what is seen: grasp, clips and cut of the plan, and further clips."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.dividing import Dividing
from controllers.cholecystectomy.places import (
    CUFF,
    FIRST,
    LAST,
    STAYS,
    cut_window,
    free_place,
    further_place,
)
from controllers.cholecystectomy.procedure import GRASP
from controllers.cholecystectomy.sub_task import CLIPS, CUT

__all__ = ["NextJob"]


class NextJob(Dividing):
    """Counts the clips where they lie, and looks for leaks."""

    @property
    def order(self) -> tuple[int, int]:
        """Numbers of the tubes, that in front first."""
        return (1, 0) if self.state.second_first else (0, 1)

    def next_job(self) -> tuple[int, int, float] | None:
        """Return tube, job, and the place of a further clip or -1; None: nothing is left to do."""
        state = self.state
        if not state.grasped and not state.parted.all():
            return GRASP, 0, -1.0
        for tube in self.order:
            for job in range(CLIPS):
                if state.clip_places[tube, job] < 0.0:
                    return tube, job, -1.0
            further = self._further(tube)
            if further is not None:
                return further
            if not state.parted[tube]:
                return tube, CUT, -1.0
        return None

    def _further(self, tube: int) -> tuple[int, int, float] | None:
        """Return the job of a further clip: a cuff is too short, a clip is missing, or a stump leaks."""
        state, line, clips = self.state, self.seen.tube(tube), self.closed(tube)
        if (state.further[tube] >= 0.0).all():
            return None
        if not state.parted[tube]:
            place = None if cut_window(clips) is not None else further_place(line.length, clips)
            return None if place is None else self._add(tube, place, float(np.median(clips)))
        side = self.open_side(tube)
        place = None if side is None else free_place(*side, clips)
        return None if place is None else self._add(tube, place, float(line.partings[0]))

    def _add(self, tube: int, place: float, middle: float) -> tuple[int, int, float]:
        """Return the job of a further clip: the second clip's beyond the middle, else the third's."""
        return tube, 1 if place > middle else CLIPS - 1, place

    def open_side(self, tube: int) -> tuple[float, float] | None:
        """Return the stump (m) of a parted tube that leaks or has too few clips; None: no such stump."""
        line, clips, leak = self.seen.tube(tube), self.closed(tube), float(self.state.leaks[tube])
        if not line.partings.size:  # an end of the tube has come off, and nothing shows where it was parted
            return None
        first, last = float(line.partings[0]), float(line.partings[-1])
        if (clips > last).sum() < STAYS or leak > last:
            return last + CUFF, line.length - LAST
        if not (clips < first).any() or 0.0 <= leak < first:
            return FIRST, first - CUFF
        return None
