"""Metrics of what should not happen: collisions, force, falls, instruments out of view; and of clutching."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant, Watched
from tasks.metrics.metric import NO_CAMERA, Metric, missing

__all__ = ["Clutching", "Collisions", "Counts", "Forces", "Time", "View"]


class TimeState(Record):
    """Of the trial."""

    time = number()
    done_at = number(-1.0)
    """s; -1: not done."""


class Time(Metric[TimeState]):
    """Time of the trial so far, and until all goals were reached."""

    def __init__(self) -> None:
        self.state = TimeState()

    def take(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Take the time."""
        self.state.time = now.time_s

    def finish(self) -> None:
        """Say that all goals are reached now."""
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

    def take(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
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


class CollisionsState(Record):
    """Between instruments."""

    count = integer()
    impulse = number()
    """N s."""


class Collisions(Metric[CollisionsState]):
    """How often instruments of different arms touch one another, and the impulse of it."""

    def __init__(self, watched: Watched) -> None:
        self.state = CollisionsState()
        self._reason = "" if watched.tools else "contact is not known: connect or record tools/impulse"

    def take(self, now: Instant, events: Sequence[Event]) -> None:
        """Count contacts."""
        self.state.count += sum(event.kind == "collision" for event in events)
        self.state.impulse = now.impulse

    def values(self) -> Iterator[ScoreValue]:
        """Yield the count and the impulse, N s."""
        rows = ("tool_collisions", float(self.state.count), ""), ("tool_impulse", self.state.impulse, "N*s")
        for name, value, unit in rows:
            if self._reason:
                yield missing(name, unit, self._reason)
            else:
                yield ScoreValue(name=name, value=value, unit=unit)


class ForcesState(Record):
    """Of each arm."""

    peak = array("arms")
    """N."""
    excess = array("arms")
    """s."""


class Forces(Metric[ForcesState]):
    """Peak of the force on each instrument, and how long it was over a limit."""

    def __init__(self, watched: Watched, limit: float) -> None:
        """Measure with a `limit` in N."""
        self.state = ForcesState(arms=len(watched.arms))
        self._watched, self._limit = watched, limit

    def take(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Take the forces."""
        for i, force in enumerate(now.forces):
            if force > self.state.peak[i]:
                self.state.peak[i] = force
            if force > self._limit:
                self.state.excess[i] += now.period_s

    def values(self) -> Iterator[ScoreValue]:
        """Yield the peaks, N, and the times, s."""
        for name, values, unit in (
            ("peak_force", self.state.peak, "N"),
            ("excessive_force_time", self.state.excess, "s"),
        ):
            for arm, value, known in zip(
                self._watched.arms, values.tolist(), self._watched.forces, strict=True
            ):
                if known:
                    yield ScoreValue(name=f"{arm}/{name}", value=value, unit=unit)
                else:
                    reason = f"the force is not known: connect or record {arm}/rigid_wrench or tip_wrench"
                    yield missing(f"{arm}/{name}", unit, reason)


class ViewState(Record):
    """Of each arm."""

    unseen = array("arms")
    """s."""


class View(Metric[ViewState]):
    """How long each tip was outside of what the endoscope sees."""

    def __init__(self, watched: Watched) -> None:
        self.state = ViewState(arms=len(watched.arms))
        self._watched = watched

    def take(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add one period for the tips that are not seen."""
        for i, seen in enumerate(now.tips_seen.tolist()):
            if not seen:
                self.state.unseen[i] += now.period_s

    def values(self) -> Iterator[ScoreValue]:
        """Yield the times, s."""
        for arm, time in zip(self._watched.arms, self.state.unseen.tolist(), strict=True):
            name = f"{arm}/out_of_view_time"
            if self._watched.camera:
                yield ScoreValue(name=name, value=time, unit="s")
            else:
                yield missing(name, "s", NO_CAMERA)


class ClutchingState(Record):
    """Of each arm."""

    count = array("arms")
    led = array("arms")
    """1 while a hand leads it."""


class Clutching(Metric[ClutchingState]):
    """How often each hand let go of its arm."""

    def __init__(self, watched: Watched) -> None:
        self.state = ClutchingState(arms=len(watched.arms))
        self._watched = watched

    def take(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Count the hands that let go now."""
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
