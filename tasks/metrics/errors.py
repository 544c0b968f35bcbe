"""Metrics of errors: instruments colliding, pressing too hard or out of view."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant, Watched
from tasks.metrics.metric import NO_CAMERA, Metric, missing
from tasks.objects import CONTACT_GAP

__all__ = ["Collisions", "FixtureCollisions", "Forces", "View"]

_UNKNOWN = (
    "contact is not known: connect or record tools/impulse, which a MuJoCo robot has in a scene with fixtures"
)


class CollisionsState(Record):
    """Between instruments."""

    count = integer()
    impulse = number()
    """N s."""


class Collisions(Metric[CollisionsState]):
    """Number and impulse of contacts between instruments of different arms."""

    def __init__(self, watched: Watched) -> None:
        self.state = CollisionsState()
        self._reason = "" if watched.tools else _UNKNOWN

    def update(self, now: Instant, events: Sequence[Event]) -> None:
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


class FixtureCollisionsState(Record):
    """Between instruments and fixtures."""

    count = integer()
    impulse = number()
    """N s."""
    gap = number(CONTACT_GAP)
    """Time since the last contact, s."""


class FixtureCollisions(Metric[FixtureCollisionsState]):
    """Number and impulse of contacts of instruments with boards, posts, walls and dishes.

    A contact is new after `CONTACT_GAP` without contact.
    """

    def __init__(self, watched: Watched) -> None:
        self.state = FixtureCollisionsState()
        self._known = watched.fixtures

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Count contacts."""
        state = self.state
        state.gap += now.period_s
        if now.fixture_impulse > state.impulse:
            state.count += state.gap >= CONTACT_GAP
            state.gap, state.impulse = 0.0, now.fixture_impulse

    def values(self) -> Iterator[ScoreValue]:
        """Yield the count and the impulse, N s."""
        rows = (
            ("fixture_collisions", float(self.state.count), ""),
            ("fixture_impulse", self.state.impulse, "N*s"),
        )
        for name, value, unit in rows:
            if self._known:
                yield ScoreValue(name=name, value=value, unit=unit)
            else:
                yield missing(name, unit, "contact is not known: connect or record fixtures/impulse")


class ForcesState(Record):
    """Of each arm."""

    peak = array("arms")
    """N."""
    excess = array("arms")
    """s."""


class Forces(Metric[ForcesState]):
    """Peak of the force on each instrument, and time over a limit."""

    def __init__(self, watched: Watched, limit: float) -> None:
        """Measure with a `limit` in N."""
        self.state = ForcesState(arms=len(watched.arms))
        self._watched, self._limit = watched, limit

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
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
    """Time of each tip outside of the endoscope's view."""

    def __init__(self, watched: Watched) -> None:
        self.state = ViewState(arms=len(watched.arms))
        self._watched = watched

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add a period for each tip out of view."""
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
