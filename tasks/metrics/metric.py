"""What a metric is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Generic, TypeVar

from hub.participant import Record
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant

__all__ = ["NO_CAMERA", "AnyMetric", "Metric", "missing"]

NO_CAMERA = "no endoscope: state an ECM in the scene and connect or record ECM/measured_cp"


S = TypeVar("S", bound=Record)


class Metric(ABC, Generic[S]):
    """One or some numbers about a trial, computed while it goes on; its whole memory is in `state`."""

    state: S

    @abstractmethod
    def take(self, now: Instant, events: Sequence[Event]) -> None:
        """Take one instant, and the events in it."""

    @abstractmethod
    def values(self) -> Iterator[ScoreValue]:
        """Yield the numbers so far, each by its name."""


AnyMetric = Metric[Any]


def missing(name: str, unit: str, reason: str) -> ScoreValue:
    """Return a number that cannot be given, and why."""
    return ScoreValue(name=name, unit=unit, reason=reason)
