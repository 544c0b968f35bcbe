"""Phases of the operation as Cholec80 has them (Twinanda et al. 2017), told from the state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from hub.participant import Record, array, integer
from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.tissue_seen import TissueSeen
from tasks.cholecystectomy.tubes import TubeWatch
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.events import Event
from tasks.instant import Instant

__all__ = ["PHASES", "Phases"]

PHASES = (
    "preparation",
    "calot-triangle-dissection",
    "clipping-and-cutting",
    "gallbladder-dissection",
    "gallbladder-packaging",
    "cleaning-and-coagulation",
    "gallbladder-retraction",
)
"""Names of the phases, in order."""
_CALOT, _CLIPPING, _BED, _PACKAGING, _CLEANING, _RETRACTION = range(1, 7)
_ABSENT: Mapping[int, str] = MappingProxyType(
    {
        _PACKAGING: "there is no specimen bag",
        _RETRACTION: "the gallbladder is not drawn out through a port",
    }
)


class PhasesState(Record):
    """The present phase, and the time of each."""

    phase = integer()
    times = array(len(PHASES))
    """s."""


class Phases(Watch[PhasesState]):
    """The present phase and the time of each; also makes an event when one begins."""

    def __init__(self, seen: TissueSeen, tubes: Sequence[TubeWatch], places: int) -> None:
        """`places`: index of the first phase among the places of events."""
        self.state = PhasesState()
        self._seen, self._tubes, self._places = seen, tubes, places

    def observe(self, now: Instant, *, freed: bool) -> Iterator[Event]:
        """Add a period; yield an event if a phase begins. `freed`: the gallbladder is off the liver."""
        state = self.state
        state.times[state.phase] += now.period_s
        phase = max(state.phase, self._find(freed=freed))
        if phase != state.phase:
            state.phase = phase
            yield Event("phase", place=self._places + phase)

    def _find(self, *, freed: bool) -> int:
        tubes = self._tubes
        if all(tube.state.cut_count for tube in tubes):
            return _CLEANING if freed else _BED
        if any(tube.state.count or tube.state.cut_count for tube in tubes):
            return _CLIPPING
        return _CALOT if any(arm.held or arm.power > 0.0 for arm in self._seen.arms) else 0

    def values(self) -> Iterator[ScoreValue]:
        """Yield the times, s."""
        for phase, (name, time) in enumerate(zip(PHASES, self.state.times.tolist(), strict=True)):
            reason = _ABSENT.get(phase, "" if time else "this phase has not begun")
            yield value_or_reason(f"phase/{name}", time, "s", reason)
