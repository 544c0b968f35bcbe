"""Counting metrics: time, events of objects, and clutching."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant, Watched
from tasks.metrics.metric import Metric, missing

__all__ = ["Clutching", "Counts", "Time"]


class TimeState(Record):
    """Of the trial."""

    time = number()
    done_at = number(-1.0)
    """s; -1: not done."""


class Time(Metric[TimeState]):
    """Time of the trial so far, and until all goals were reached."""

    def __init__(self) -> None:
        self.state = TimeState()

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Take the time."""
        self.state.time = now.time_s

    def finish(self) -> None:
        """Note the time of reaching all goals."""
        self.state.done_at = self.state.time

    def values(self) -> Iterator[ScoreValue]:
        """Yield both times, s."""
        name, state = "completion_time", self.state
        if state.done_at >= 0.0:
            yield ScoreValue(name=name, value=state.done_at, unit="s")
        else:
            yield missing(name, "s", "the task is not done")
        yield ScoreValue(name="trial_time", value=state.time, unit="s")


class CountsState(Record):
    """How often, since the start."""

    grasps = integer()
    hand_overs = integer()
    drops = integer()
    lost = integer()


class Counts(Metric[CountsState]):
    """How often objects were grasped, handed over, dropped and lost from the workspace."""

    def __init__(self, things: int) -> None:
        """Count for `things` objects."""
        self.state = CountsState()
        self._things = things

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Count events."""
        state = self.state
        for event in events:
            state.grasps += event.kind == "grasped"
            state.hand_overs += event.kind == "handed over"
            state.drops += event.kind == "dropped"
            state.lost += event.kind == "out of workspace"

    def values(self) -> Iterator[ScoreValue]:
        """Yield the counts."""
        for name in CountsState.fields:
            if self._things:
                yield ScoreValue(name=name, value=float(getattr(self.state, name)))
            else:
                reason = "no objects: state them in the scene, and connect or record their pose and held_by"
                yield missing(name, "", reason)


class ClutchingState(Record):
    """Of each arm."""

    count = array("arms")
    led = array("arms")
    """1 for each arm led by a hand."""


class Clutching(Metric[ClutchingState]):
    """Number of times each hand let go of the arm."""

    def __init__(self, watched: Watched) -> None:
        self.state = ClutchingState(arms=len(watched.arms))
        self._watched = watched

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Count the hands letting go now."""
        for i, said in enumerate(now.hands):
            for led in said:
                self.state.count[i] += bool(self.state.led[i]) and not led
                self.state.led[i] = led

    def values(self) -> Iterator[ScoreValue]:
        """Yield the counts."""
        for arm, count, known in zip(
            self._watched.arms, self.state.count.tolist(), self._watched.hands, strict=True
        ):
            name = f"{arm}/clutch_count"
            if known:
                yield ScoreValue(name=name, value=count)
            else:
                reason = (
                    f"no hand leads the arm: connect or record the `following` of a teleoperation to"
                    f" {arm}/following"
                )
                yield missing(name, "", reason)
