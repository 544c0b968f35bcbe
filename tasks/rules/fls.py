"""The peg transfer of the Fundamentals of Laparoscopic Surgery.

All objects over the board and back, each handed over in mid-air; timed from the first grasp to the last
release; cut off at 300 s. Proficiency: 48 s without an object lost out of the field of view (Surgeons as
Educators, chapter on FLS; docsbay eTable 1).

The score 300 - time - penalty, with the share of lost objects in per cent as penalty, is the score of
MISTELS, the origin of FLS, from memory: no stored source states the score. The scores of FLS itself are not
published.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from hub.participant import Record, array, flag, number
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.goals import Legs
from tasks.instant import Instant
from tasks.metrics.metric import NO_CAMERA
from tasks.rules.rules import Rules, Setting, missing_all

__all__ = ["Fls"]

_CUT_OFF = 300.0
_PROFICIENT = 48.0
"""s."""
_UNITS = {"score": "", "time": "s", "lost": "", "proficient": ""}


class FlsState(Record):
    """Progress of the trial."""

    begun = number(-1.0)
    """Time of the first grasp, s; -1: none."""
    time = number()
    """Since then, s, at most the cut-off."""
    done = flag()
    lost = array("objects")
    """1 for each object dropped and out of view."""
    fallen = array("objects")
    """1 for each object dropped and not grasped since."""


class Fls(Rules[FlsState]):
    """Peg transfer by the rules of FLS."""

    name: ClassVar[str] = "fls"

    def __init__(self, setting: Setting) -> None:
        count = len(setting.things)
        self.state = FlsState(objects=count)
        self._reason = (
            ""
            if setting.is_board and setting.camera
            else "these rules score a peg board: run or record a task of kind peg-board-task"
            if not setting.is_board
            else NO_CAMERA
        )
        self._legs = Legs(setting.goals, hand_over=True)
        self._transfers = 2 * count

    def records(self) -> Iterator[Record]:
        """Yield all parts of the state."""
        yield from (self.state, self._legs.state)

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Time the transfers, and note lost objects."""
        state = self.state
        if self._reason or state.done or state.time >= _CUT_OFF:
            return
        for event in events:
            self._legs.count(event)
            if event.kind == "grasped":
                state.fallen[event.thing] = 0.0
                state.begun = now.time_s if state.begun < 0.0 else state.begun
            elif event.kind == "dropped":
                state.fallen[event.thing] = 1.0
        for i, seen in enumerate(now.things_seen.tolist()):
            if state.fallen[i] and not seen:
                state.lost[i] = 1.0
        if state.begun >= 0.0:
            state.time = min(now.time_s - state.begun, _CUT_OFF)
        state.done = self._legs.state.total >= self._transfers

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:  # noqa: ARG002
        """Yield score, time, objects lost, and proficiency."""
        if self._reason:
            yield from missing_all(_UNITS, self._reason)
            return
        state, lost = self.state, float(self.state.lost.sum())
        if state.done or state.time >= _CUT_OFF:
            penalty = 100.0 * lost / len(state.lost)
            yield ScoreValue(name="score", value=max(0.0, _CUT_OFF - state.time - penalty))
        else:
            yield ScoreValue(name="score", reason="the transfers are not done")
        yield ScoreValue(name="time", value=state.time, unit="s")
        yield ScoreValue(name="lost", value=lost)
        yield ScoreValue(
            name="proficient", value=float(state.done and state.time <= _PROFICIENT and not lost)
        )
