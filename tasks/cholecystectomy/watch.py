"""The base of metrics that go on after the last goal: harm after it counts too."""

from __future__ import annotations

from collections.abc import Sequence

from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant
from tasks.metrics.metric import Metric, S, missing

__all__ = ["Watch", "value_or_reason"]


class Watch(Metric[S]):
    """Takes its numbers in a method of its own, which the task calls at every instant."""

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Do nothing: the numbers are taken already."""


def value_or_reason(name: str, value: float, unit: str = "", reason: str = "") -> ScoreValue:
    """Return a number of the card, or the reason for its absence."""
    return missing(name, unit, reason) if reason else ScoreValue(name=name, value=value, unit=unit)
