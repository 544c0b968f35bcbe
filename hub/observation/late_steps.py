"""Causes of late steps: the largest part of each step, counted by cause, and the longest steps."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Mapping

from schemas.trocar_msgs import LateCause, LateStep

__all__ = ["NO_CORE", "LateSteps"]

NO_CORE = "no free core"
_WORST = 5


class LateSteps:
    """The late steps of a run.

    A short step, no longer than its simulated time, is late because of an earlier slow step: the short step
    inherits the slow step's cause.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._worst: list[tuple[int, int, str]] = []
        self._cause = "hub"

    def add(self, steps: int, simulated_ns: int, time_ns: int, causes: Mapping[str, int]) -> None:
        """Add `steps` late steps of a grant, with the end `time_ns` and the simulated time `simulated_ns`.

        `causes` are the uses of the grant's wall time (ns).
        """
        took_ns = sum(causes.values())
        if took_ns > simulated_ns:
            self._cause = max(causes, key=lambda cause: causes[cause])
            heapq.heappush(self._worst, (took_ns, time_ns, self._cause))
            if len(self._worst) > _WORST:
                heapq.heappop(self._worst)
        self._counts[self._cause] += steps

    @property
    def cause_counts(self) -> list[LateCause]:
        """The numbers of late steps by cause, the most frequent first."""
        return [LateCause(cause=cause, steps=steps) for cause, steps in self._counts.most_common()]

    @property
    def worst_steps(self) -> list[LateStep]:
        """The longest steps, the longest first."""
        return [
            LateStep(time_ns=time_ns, took_s=took_ns / 1e9, cause=cause)
            for took_ns, time_ns, cause in sorted(self._worst, reverse=True)
        ]
