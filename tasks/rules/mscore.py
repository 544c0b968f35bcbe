"""Proficiency by MScore: every metric has to pass its benchmark, without compensation between metrics.

Source: mimicsimulation.com/mscore, of the dV-Trainer and the da Vinci Skills Simulator. MScore's benchmarks,
mean and standard deviation of experts with at least 75 cases, are not published: a scenario states its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from hub.participant import Record
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant
from tasks.rules.rules import Rules, Setting

__all__ = ["MScore"]

_MORE_IS_BETTER = ("economy", "spectral_arc_length")


class MScoreState(Record):
    """Nothing: the metrics have all."""


class MScore(Rules[MScoreState]):
    """Compares the metrics with the task's `benchmarks`."""

    name: ClassVar[str] = "mscore"

    def __init__(self, setting: Setting) -> None:
        self.state = MScoreState()
        self._benchmarks = setting.benchmarks

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Do nothing: the metrics take all."""

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:
        """Yield whether all pass, and how many of the benchmarks."""
        if not self._benchmarks:
            reason = "no benchmarks are published: state `benchmarks` of the task, by metric"
            yield ScoreValue(name="passed", reason=reason)
            yield ScoreValue(name="metrics_passed", reason=reason)
            return
        passed = sum(self._passes_benchmark(metrics[name]) for name in self._benchmarks)
        without = [name for name in self._benchmarks if metrics[name].reason]
        if without:
            yield ScoreValue(name="passed", reason=f"{without[0]}: {metrics[without[0]].reason}")
        else:
            yield ScoreValue(name="passed", value=float(passed == len(self._benchmarks)))
        yield ScoreValue(name="metrics_passed", value=float(passed))

    def _passes_benchmark(self, metric: ScoreValue) -> bool:
        limit = self._benchmarks[metric.name]
        if metric.reason:
            return False
        if metric.name.rpartition("/")[2] in _MORE_IS_BETTER:
            return metric.value >= limit
        return metric.value <= limit
