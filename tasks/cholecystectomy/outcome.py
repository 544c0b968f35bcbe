"""Goals of each part of the operation, and the classes of failure, the gravest first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from anatomy.phase import Phase
from hub.participant import Record, array, number
from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.bleeding import LossesState
from tasks.cholecystectomy.organs import ARTERY, BOWEL, COMMON_DUCT, DUCT, HEPATIC_ARTERY, ORGANS, SPARED
from tasks.cholecystectomy.params import CholecystectomyParams
from tasks.cholecystectomy.tubes import TubeWatch
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.events import Event, EventKind
from tasks.instant import Instant
from tasks.rules.operation_errors import ERRORS

__all__ = ["FAILURES", "GOALS", "Outcome"]

_CLIP_AND_CUT: tuple[EventKind, ...] = (
    "gallbladder grasped",
    "duct clipped",
    "duct cut",
    "artery clipped",
    "artery cut",
)
_VIEW: tuple[EventKind, ...] = ("triangle cleared", "plate opened")
GOALS: Mapping[Phase, tuple[EventKind, ...]] = MappingProxyType(
    {
        "clip-and-cut": _CLIP_AND_CUT,
        "calot-dissection": _VIEW,
        "gallbladder-bed": ("gallbladder freed",),
        "cholecystectomy": (_CLIP_AND_CUT[0], *_VIEW, *_CLIP_AND_CUT[1:], "gallbladder freed"),
    }
)
"""Events that reach a goal, in the usual order, by part of the operation."""

FAILURES = (
    "common duct injured",
    "hepatic artery injured",
    "bowel injured",
    "tube torn",
    "duct open",
    "artery open",
    "gallbladder perforated",
    "bleeding",
    "clips missing",
    "not finished",
)
"""Classes of failure, the gravest first; the last one is no failure while the session lasts."""
_INJURED = {COMMON_DUCT: 0, HEPATIC_ARTERY: 1, BOWEL: 2}
_TORN = 3
_OPEN = {DUCT: 4, ARTERY: 5}
_PERFORATED, _BLEEDING, _CLIPS, _UNFINISHED = range(6, 10)
_REPEAT = 2.0
"""Time within which the same lasting error of an organ is one, s."""


class OutcomeState(Record):
    """Goals, errors and failures."""

    reached = array(8)
    """Time at which each goal was reached, s; -1: not yet."""
    errors = array(len(ERRORS))
    """Count of each kind."""
    last = array(len(ERRORS), len(ORGANS) + 1)
    """Time of the last report of each kind of error in each organ, s; -1: none."""
    failed = array(len(FAILURES))
    """1 for each failure that nothing can mend."""
    consequential = number()


class Outcome(Watch[OutcomeState]):
    """Counts goals, errors and failures."""

    def __init__(
        self, params: CholecystectomyParams, tubes: Sequence[TubeWatch], losses: LossesState
    ) -> None:
        """`losses`: blood and bile so far."""
        self.state = OutcomeState()
        self.state.reached[:] = self.state.last[:] = -1.0
        self._params, self._tubes, self._losses = params, tubes, losses
        self.goals = GOALS[params.phase]
        self._kinds = list(ERRORS)

    def reach(self, event: Event, now: Instant) -> bool:
        """Return whether an event reaches a goal for the first time."""
        if event.kind not in self.goals:
            return False
        goal = self.goals.index(event.kind)
        if self.state.reached[goal] >= 0.0:
            return False
        self.state.reached[goal] = now.time_s
        return True

    def is_repeated(self, event: Event, now: Instant) -> bool:
        """Note an error; return whether it is the continuation of one that lasts."""
        error = ERRORS.get(event.kind)
        if error is None:
            return False
        state, row = self.state, self._kinds.index(event.kind)
        before = float(state.last[row, event.place])
        state.last[row, event.place] = now.time_s
        return error.lasts and before >= 0.0 and now.time_s - before < _REPEAT

    def count(self, events: Iterable[Event]) -> None:
        """Count errors, and note the failures that nothing can mend."""
        state = self.state
        for event in events:
            error = ERRORS.get(event.kind)
            if error is None:
                continue
            state.errors[self._kinds.index(event.kind)] += 1.0
            state.consequential += error.is_consequential
            name = ORGANS[event.place] if event.place >= 0 else ""
            if event.kind in ("wrong structure clipped", "wrong structure hurt") and name in SPARED:
                state.failed[_INJURED[name]] = 1.0
            elif event.kind == "tube torn":
                state.failed[_TORN] = 1.0
            elif event.kind == "gallbladder perforated":
                state.failed[_PERFORATED] = 1.0

    @property
    def failures(self) -> list[bool]:
        """Whether each class of failure holds now; `not finished` as if the session ended."""
        found = [bool(one) for one in self.state.failed.tolist()]
        for tube in self._tubes:
            cuts = tube.state.cuts[: tube.state.cut_count]
            if not cuts.size:
                continue
            stays = int((tube.clips >= cuts.max()).sum())
            found[_OPEN[tube.name]] = stays == 0
            found[_CLIPS] |= stays < self._params.stays
        found[_BLEEDING] = self._losses.blood > self._params.blood_limit
        found[_UNFINISHED] = bool((self.state.reached[: len(self.goals)] < 0.0).any())
        return found

    @property
    def failure(self) -> int:
        """Number of the gravest failure so far, from 1; 0: none."""
        grave = self.failures[:_UNFINISHED]
        return grave.index(True) + 1 if any(grave) else 0

    @property
    def success(self) -> bool:
        """Whether all goals are reached and nothing has failed."""
        return not any(self.failures)

    def values(self) -> Iterator[ScoreValue]:
        """Yield success, the classes of failure, times of goals (s), and counts of errors."""
        state = self.state
        yield ScoreValue(name="success", value=float(self.success))
        for name, holds in zip(FAILURES, self.failures, strict=True):
            yield ScoreValue(name=f"failed/{name.replace(' ', '_')}", value=float(holds))
        for name, at in zip(self.goals, state.reached.tolist(), strict=False):
            full = f"goal/{name.replace(' ', '_')}"
            yield value_or_reason(full, at, "s", "" if at >= 0.0 else "not reached")
        yield ScoreValue(name="errors", value=float(state.errors.sum()))
        yield ScoreValue(name="errors/consequential", value=state.consequential)
        for kind, count in zip(self._kinds, state.errors.tolist(), strict=True):
            yield ScoreValue(name=f"errors/{kind.replace(' ', '_')}", value=count)
