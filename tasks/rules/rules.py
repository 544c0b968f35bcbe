"""The base of sets of rules."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from hub.participant import Record
from robots import rotation
from robots.training.needles import NeedleShape
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.goals import Goals
from tasks.instant import Instant

__all__ = ["AnyRules", "Rules", "Setting", "Suture", "TipByHoles", "missing_all"]


class TipByHoles:
    """Place of a needle's tip at the holes, computed once per pose for several rules."""

    def __init__(self, holes: Vector, needle: NeedleShape) -> None:
        self._places, self._axes = holes[:, :3, 3], holes[:, :3, :3]
        self._tip, self._pose = needle.marks[2:], b""
        self._found = 0, np.zeros((0, 3))

    def at(self, pose: Vector) -> tuple[int, Vector]:
        """Return the nearest hole to the tip of a needle at `pose`, (7,), and the tip in all holes' frames.

        The latter in m, shape (2 n, 3).
        """
        if (seen := pose.tobytes()) != self._pose:
            self._pose = seen
            tip: Vector = (self._tip @ rotation.matrix(pose[3:]).T + pose[:3])[0]
            away = tip - self._places
            here = np.einsum("nji,nj->ni", self._axes, away)
            self._found = int((away * away).sum(axis=1).argmin()), here
        return self._found


@dataclass(frozen=True)
class Suture:
    """Setting of a suturing task, for rules."""

    holes: Vector
    """Frames of all holes in the world, entries before exits, shape (2 n, 4, 4), m; z out of the tissue."""
    needle: NeedleShape
    thing: int
    """Index of the needle among the objects."""
    estimated: bool
    """Whether there is an estimate of the needle's pose."""
    asked: bool
    """Whether a report ends a stitch."""

    @cached_property
    def tip(self) -> TipByHoles:
        """The tip of the needle by the holes."""
        return TipByHoles(self.holes, self.needle)


@dataclass(frozen=True)
class Setting:
    """Setting of the scored task, for rules."""

    things: tuple[str, ...]
    goals: Goals
    is_board: bool
    """Whether the task is a peg board."""
    camera: bool
    """Whether the endoscope's view is known."""
    benchmarks: Mapping[str, float]
    suture: Suture | None = None


S = TypeVar("S", bound=Record)


class Rules(ABC, Generic[S]):
    """Scores of a foreign evaluator, computed during the trial; the whole memory is in `records`."""

    name: ClassVar[str]
    state: S

    @abstractmethod
    def __init__(self, setting: Setting) -> None: ...

    def records(self) -> Iterator[Record]:
        """Yield all parts of the state."""
        yield self.state

    @abstractmethod
    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Observe an instant and its events."""

    @abstractmethod
    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:
        """Yield the scores so far; `metrics`: metrics of the card."""


AnyRules = Rules[Any]


def missing_all(rows: Mapping[str, str], reason: str) -> Iterator[ScoreValue]:
    """Yield scores without values; `rows` has the unit of each."""
    for name, unit in rows.items():
        yield ScoreValue(name=name, unit=unit, reason=reason)
