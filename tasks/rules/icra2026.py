"""The peg transfer of the Surgical Robotics Challenge at ICRA 2026, in both published readings.

Source: surgical-robotics-ai.github.io, icra-competition-2026/rules.md (`icra2026`), and the live page of the
challenge (`icra2026-live`). Differences: the effect of a ring out of the workspace, and the breaking of a
tie.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from hub.participant import Record, flag, number
from schemas.plain_sum import plain_sum
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.goals import Legs
from tasks.instant import Instant
from tasks.rules.rules import Rules, Setting, missing_all

__all__ = ["Icra2026", "Icra2026Live"]

_LIMIT = 180.0
"""s."""
_UNITS = {"points": "", "placed_any": "", "tie": "", "time": "s"}
_REASON = "these rules score a peg board: run or record a task of kind peg-board-task"


class Icra2026State(Record):
    """Progress of the trial."""

    time = number()
    """s, at most the limit; where the trial has ended."""
    ended = flag()
    last = number(-1.0)
    """Time of the last point, s; -1: none."""
    motion = number()
    """Paths of all tips until then, m."""


class Icra2026(Rules[Icra2026State]):
    """Rules of the challenge's repository.

    A ring out of the workspace ends the trial. At equal points, less motion of the PSMs is better.
    """

    name: ClassVar[str] = "icra2026"
    _goes_on: ClassVar[bool] = False

    def __init__(self, setting: Setting) -> None:
        self.state = Icra2026State()
        self._applies = setting.is_board
        self._legs = Legs(setting.goals, hand_over=True)

    def records(self) -> Iterator[Record]:
        """Yield all parts of the state."""
        yield from (self.state, self._legs.state)

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Count a point for each ring placed after a hand-over, until the limit."""
        state = self.state
        if state.ended or not self._applies:
            return
        state.time = now.time_s
        if now.is_smooth:
            state.motion += plain_sum(now.speeds) * now.period_s
        for event in events:
            if self._legs.count(event):
                state.last = now.time_s
            if event.kind == "out of workspace" and not self._goes_on:
                state.ended = True
        if now.time_s >= _LIMIT:
            state.time, state.ended = _LIMIT, True

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:  # noqa: ARG002
        """Yield the points, success (any point), the tie-breaker (less is better), and the time."""
        if not self._applies:
            yield from missing_all(_UNITS, _REASON)
            return
        points = self._legs.state.total
        yield ScoreValue(name="points", value=float(points))
        yield ScoreValue(name="placed_any", value=float(points > 0))
        yield self._tie_breaker()
        yield ScoreValue(name="time", value=self.state.time, unit="s")

    def _tie_breaker(self) -> ScoreValue:
        return ScoreValue(name="tie", value=self.state.motion, unit="m")


class Icra2026Live(Icra2026):
    """Rules of the challenge's live page.

    After a ring has left the workspace the trial goes on with the rest. Of equal points, an earlier last
    success is better.
    """

    name: ClassVar[str] = "icra2026-live"
    _goes_on: ClassVar[bool] = True

    def _tie_breaker(self) -> ScoreValue:
        if self.state.last < 0.0:
            return ScoreValue(name="tie", unit="s", reason="no ring has been placed")
        return ScoreValue(name="tie", value=self.state.last, unit="s")
