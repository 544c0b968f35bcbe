"""The base of metrics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, Generic, TypeVar

from hub.participant import Record
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant

__all__ = ["NO_CAMERA", "AnyMetric", "Metric", "S", "missing"]

NO_CAMERA = "no endoscope: state an ECM in the scene and connect or record ECM/measured_cp"


S = TypeVar("S", bound=Record)


class Metric(ABC, Generic[S]):
    """Numbers about a trial, computed during the trial; the whole memory is in `state`."""

    state: S

    @abstractmethod
    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Observe an instant and its events."""

    @abstractmethod
    def values(self) -> Iterator[ScoreValue]:
        """Yield the numbers so far, with names."""


AnyMetric = Metric[Any]


def missing(name: str, unit: str, reason: str) -> ScoreValue:
    """Return a number without a value, with the reason."""
    return ScoreValue(name=name, unit=unit, reason=reason)
