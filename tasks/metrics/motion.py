"""Metrics of the tips' paths. Their definitions are in docs/scores.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import sqrt

import numpy as np

from hub.participant import Record, array, number
from robots import rotation
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant
from tasks.metrics.metric import Metric, missing

__all__ = ["Economy", "Paths", "Turning", "WorkingVolume"]

_STILL = "the tip has not moved"
_SHORT = "the trial is too short"


class PathsState(Record):
    """Sums over the trial, for each tip."""

    length = array("arms")
    idle = array("arms")
    time = number()


class Paths(Metric[PathsState]):
    """Path length and idle share of each tip."""

    def __init__(self, arms: Sequence[str], idle_speed: float) -> None:
        """Measure `arms`; below `idle_speed` (m/s) a tip is idle."""
        self.state = PathsState(arms=len(arms))
        self._arms, self._idle_speed = arms, idle_speed

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add the path of a period."""
        if not now.is_smooth:
            return
        for i, speed in enumerate(now.speeds):
            self.state.length[i] += speed * now.period_s
            if speed < self._idle_speed:
                self.state.idle[i] += now.period_s
        self.state.time += now.period_s

    def values(self) -> Iterator[ScoreValue]:
        """Yield the lengths (m) and the shares."""
        state = self.state
        for arm, length in zip(self._arms, state.length.tolist(), strict=True):
            name = f"{arm}/path_length"
            yield ScoreValue(name=name, value=length, unit="m") if state.time else missing(name, "m", _SHORT)
        for arm, idle in zip(self._arms, state.idle.tolist(), strict=True):
            name = f"{arm}/idle_share"
            yield ScoreValue(name=name, value=idle / state.time) if state.time else missing(name, "", _SHORT)


class EconomyState(Record):
    """Of each tip."""

    straight = array("arms")
    """Sum of the distances between the arm's events, m."""
    length = array("arms")
    """Path, m."""
    last = array("arms", 3)
    """Position at the arm's last event, m."""
    begun = number()


class Economy(Metric[EconomyState]):
    """Economy of motion: straight distances between a tip's events over the tip's path."""

    def __init__(self, arms: Sequence[str]) -> None:
        self.state = EconomyState(arms=len(arms))
        self._arms = arms

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Add the straight distances ending now."""
        state = self.state
        if not state.begun:
            state.begun, state.last[:] = 1.0, now.tips
        if now.is_smooth:
            state.length[:] += np.array(now.speeds) * now.period_s
        for i in {event.arm for event in events if event.arm >= 0}:
            state.straight[i] += np.linalg.norm(now.tips[i] - state.last[i])
            state.last[i] = now.tips[i]

    def values(self) -> Iterator[ScoreValue]:
        """Yield the shares."""
        for arm, straight, length in zip(self._arms, *map(np.ndarray.tolist, self._sums), strict=True):
            name = f"{arm}/economy"
            if not straight:
                yield missing(name, "", "the arm has held nothing")
            elif not length:
                yield missing(name, "", _STILL)
            else:
                yield ScoreValue(name=name, value=straight / length)

    @property
    def _sums(self) -> tuple[np.ndarray, np.ndarray]:
        return self.state.straight, self.state.length


class VolumeState(Record):
    """Mean position of each tip, and sum of the squared distances from the mean (Welford)."""

    mean = array("arms", 3)
    squares = array("arms")
    count = number()


class WorkingVolume(Metric[VolumeState]):
    """Radius of each tip's working volume: root mean square distance from the mean position."""

    def __init__(self, arms: Sequence[str]) -> None:
        self.state = VolumeState(arms=len(arms))
        self._arms = arms

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add the positions."""
        state = self.state
        state.count += 1.0
        away = now.tips - state.mean
        state.mean[:] += away / state.count
        state.squares[:] += np.einsum("ij,ij->i", away, now.tips - state.mean)

    def values(self) -> Iterator[ScoreValue]:
        """Yield the radii, m."""
        for arm, squares in zip(self._arms, self.state.squares.tolist(), strict=True):
            name = f"{arm}/workspace_radius"
            if self.state.count:
                yield ScoreValue(name=name, value=sqrt(squares / self.state.count), unit="m")
            else:
                yield missing(name, "m", _SHORT)


class TurningState(Record):
    """Of each tip."""

    angle = array("arms")
    """Sum of all turns, rad."""
    before = array("arms", 4)
    """Orientation at the last instant."""
    begun = number()


class Turning(Metric[TurningState]):
    """Angular path: the sum of each tip's rotation angles."""

    def __init__(self, arms: Sequence[str]) -> None:
        self.state = TurningState(arms=len(arms))
        self._arms = arms

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add the angle of a period."""
        state = self.state
        if state.begun:
            for i, (turn, before) in enumerate(zip(now.turns, state.before, strict=True)):
                by = rotation.log(rotation.product(rotation.conjugate(before), turn))
                state.angle[i] += np.linalg.norm(by)
        state.begun, state.before[:] = 1.0, now.turns

    def values(self) -> Iterator[ScoreValue]:
        """Yield the angles, rad."""
        for arm, angle in zip(self._arms, self.state.angle.tolist(), strict=True):
            name = f"{arm}/angular_path"
            begun = self.state.begun
            yield ScoreValue(name=name, value=angle, unit="rad") if begun else missing(name, "rad", _SHORT)
