"""Blood lost and bile spilled, with the grade of a bleeding."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator

from hub.participant import Record, number
from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.tissue_seen import TissueSeen
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.instant import Instant

__all__ = ["Losses"]

_GRADES = (1.0, 5.0, 10.0, 50.0)
"""Upper ends of the grades 0 (none) to 3 (severe) of a bleeding, ml/min (Lewis et al. 2017)."""
_NO_LIQUID = "no organ of it has `lumen` or `bleeding`: connect or record tissue/<organ>/blood/lost"


class LossesState(Record):
    """Liquid so far."""

    blood = number()
    bile = number()
    """ml."""
    flow = number()
    """Present flow of blood, ml/s."""
    peak = number()
    """Largest flow of blood, ml/s."""
    bleeds = number()
    """Time with a bleeding above the least grade, s."""


class Losses(Watch[LossesState]):
    """Volumes, largest flow, grade, and time of bleeding."""

    def __init__(self, seen: TissueSeen) -> None:
        self.state = LossesState()
        self._seen = seen

    def observe(self, now: Instant) -> None:
        """Take volumes and flows."""
        state = self.state
        state.blood, state.bile = self._seen.lost(bile=False) or 0.0, self._seen.lost(bile=True) or 0.0
        state.flow = self._seen.flow(bile=False)
        state.peak = max(state.peak, state.flow)
        state.bleeds += now.period_s * (60.0 * state.flow > _GRADES[0])

    def values(self) -> Iterator[ScoreValue]:
        """Yield volumes (ml), flow (ml/s), grade and time (s)."""
        state = self.state
        rows = (
            ("blood_lost", state.blood, "ml"),
            ("bleeding_peak", state.peak, "ml/s"),
            ("bleeding_grade", float(bisect_left(_GRADES, 60.0 * state.peak)), ""),
            ("bleeding_time", state.bleeds, "s"),
        )
        reason = _NO_LIQUID if self._seen.lost(bile=False) is None else ""
        for name, value, unit in rows:
            yield value_or_reason(name, value, unit, reason)
        reason = _NO_LIQUID if self._seen.lost(bile=True) is None else ""
        yield value_or_reason("bile_spilled", state.bile, "ml", reason)
