"""What a set of rules is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from hub.participant import Record
from robots.training.needles import NeedleShape
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.goals import Goals
from tasks.instant import Instant

__all__ = ["AnyRules", "Rules", "Setting", "Suture", "missing_all"]


@dataclass(frozen=True)
class Suture:
    """What rules know of a task in which a needle is to go through a phantom."""

    holes: Vector
    """Frames of all holes in the world, entries before exits, shape (2 n, 4, 4), m; z out of the tissue."""
    needle: NeedleShape
    thing: int
    """Index of the needle among the objects."""
    estimated: bool
    """Whether there is an estimate of its pose."""
    asked: bool
    """Whether a report is what ends a stitch."""


@dataclass(frozen=True)
class Setting:
    """What rules know of the task that they score."""

    things: tuple[str, ...]
    goals: Goals
    is_board: bool
    """Whether it is a peg board."""
    camera: bool
    """Whether the endoscope's view is known."""
    benchmarks: Mapping[str, float]
    suture: Suture | None = None


S = TypeVar("S", bound=Record)


class Rules(ABC, Generic[S]):
    """Scores of one foreign evaluator, computed while the trial goes on; the whole memory is in `records`."""

    name: ClassVar[str]
    state: S

    @abstractmethod
    def __init__(self, setting: Setting) -> None: ...

    def records(self) -> Iterator[Record]:
        """Yield the state, in all its parts."""
        yield self.state

    @abstractmethod
    def take(self, now: Instant, events: Sequence[Event]) -> None:
        """Take one instant, and the events in it."""

    @abstractmethod
    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:
        """Yield the scores so far; `metrics` are those of the card."""


AnyRules = Rules[Any]


def missing_all(rows: Mapping[str, str], reason: str) -> Iterator[ScoreValue]:
    """Yield scores that cannot be given; `rows` has the unit of each."""
    for name, unit in rows.items():
        yield ScoreValue(name=name, unit=unit, reason=reason)
