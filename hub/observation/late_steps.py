"""Why steps are late: what took most of each, counted by cause, and the longest of them."""

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

    A step that took no longer than the time it simulates is late because of one before it, which it helps to
    catch up: its cause is that of the other.
    """

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._worst: list[tuple[int, int, str]] = []
        self._cause = "hub"

    def add(self, steps: int, simulated_ns: int, time_ns: int, causes: Mapping[str, int]) -> None:
        """Add `steps` late steps of one grant, which end at `time_ns` and simulate `simulated_ns`.

        `causes` are what the grant's wall time (ns) was used for.
        """
        took_ns = sum(causes.values())
        if took_ns > simulated_ns:
            self._cause = max(causes, key=lambda cause: causes[cause])
            heapq.heappush(self._worst, (took_ns, time_ns, self._cause))
            if len(self._worst) > _WORST:
                heapq.heappop(self._worst)
        self._counts[self._cause] += steps

    @property
    def causes(self) -> list[LateCause]:
        """The numbers of late steps by cause, the most frequent first."""
        return [LateCause(cause=cause, steps=steps) for cause, steps in self._counts.most_common()]

    @property
    def worst(self) -> list[LateStep]:
        """The longest steps, the longest first."""
        return [
            LateStep(time_ns=time_ns, took_s=took_ns / 1e9, cause=cause)
            for took_ns, time_ns, cause in sorted(self._worst, reverse=True)
        ]
