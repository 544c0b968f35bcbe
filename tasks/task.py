"""The base of every training task: a watching controller with a score."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np

from hub.participant import Controller, Inputs, Outputs, Params, Record, Setup, array, flag, integer
from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port
from schemas.ros import Header, Time
from schemas.trocar_msgs import RuleScore, ScoreCard, ScoreValue, TaskEvent
from schemas.vectors import Vector
from tasks.events import Event
from tasks.goals import Goals, Legs
from tasks.instant import Instant, Reader
from tasks.metrics import make_metrics
from tasks.metrics.metric import AnyMetric
from tasks.metrics.smoothing import Smoothing
from tasks.objects import ObjectWatch
from tasks.params import TaskParams
from tasks.ports import task_ports
from tasks.rules import GENERAL, RULES, Setting, Suture

__all__ = ["Task"]


class TaskState(Record):
    """Progress of the task."""

    begun = flag()
    reached = integer()
    """Goals."""
    progress = array(1)
    """Share of the goals."""
    done = array(1)


class Task(Controller):
    """Watches objects, instruments and endoscope; makes events, metrics and scores.

        class LiftTask(Task):
            name_of_kind = "lift-task"

            def reaches(self, event: Event) -> bool:
                return event.kind == "lifted"

    A goal for each object, unless `goal_count` is overridden. A task with places has `goals` and `place_of`,
    and an object reaches its goal at a target place.
    """

    params_model: ClassVar[type[Params]] = TaskParams
    name_of_kind: ClassVar[str]
    """On the score card."""
    is_board: ClassVar[bool] = False
    """Whether the rules of peg boards apply."""
    default_rules: ClassVar[tuple[str, ...]] = GENERAL
    """Default rules on the card."""

    def __init__(self, name: str, params: TaskParams) -> None:
        super().__init__(name, params)
        self.things: tuple[str, ...] = tuple(params.objects)
        """Names of the objects."""
        self._check_names()

    @property
    def goals(self) -> Goals:
        """The places of the task, with the targets of objects; none by default."""
        return Goals()

    @property
    def goal_count(self) -> int:
        """How many events have to reach a goal until the task is done."""
        return len(self.things)

    @property
    def workspace(self) -> Vector | None:
        """Least and greatest allowed coordinates of an object, m, shape (2, 3); None: any."""
        return None

    def place_of(self, thing: int, pose: Vector) -> int:  # noqa: ARG002
        """Return the index of the place of object `thing` at `pose`, shape (7,); -1: none."""
        return -1

    @property
    def suture(self) -> Suture | None:
        """Setting of a suturing task, for rules; None: no suturing."""
        return None

    @property
    def more_metrics(self) -> tuple[AnyMetric, ...]:
        """Metrics of this task alone."""
        return ()

    def observe(self, inputs: Inputs, now: Instant) -> None:
        """Read the task's own inputs, at the beginning of a step."""

    def more_events(self, now: Instant) -> Iterable[Event]:  # noqa: ARG002
        """Return the task's own events, after the events of objects."""
        return ()

    def reaches(self, event: Event) -> bool:
        """Say whether a goal is reached by `event`; called once for each event, in order."""
        return self._legs is not None and self._legs.count(event)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Watched inputs and reported outputs."""
        return task_ports(self.params)

    def configure(self, setup: Setup) -> Outputs:
        """Prepare metrics and rules for the connected inputs."""
        params, goals = self.params, self.goals
        self._reader = Reader(params, setup.connected)
        watched = self._reader.watched
        self._watched, self._goals, self._count = watched, goals, self.goal_count
        corners = np.array(params.workspace) if params.workspace else None
        box = self.workspace if corners is None else np.stack([corners.min(axis=0), corners.max(axis=0)])
        self._now = Instant(len(watched.arms), len(watched.things), period_s=setup.period_ns / 1e9)
        self._smoothing = Smoothing(len(watched.arms), setup.period_ns / 1e9)
        self._events = ObjectWatch(len(watched.things), params, box, self.place_of)
        self._legs = Legs(goals, hand_over=goals.hand_over) if goals.targets else None
        self._time, self._metrics = make_metrics(params, watched)
        self._metrics = (*self._metrics, *self.more_metrics)
        setting = Setting(
            watched.things, goals, self.is_board, watched.camera, params.benchmarks, self.suture
        )
        self._rules = [RULES[name](setting) for name in params.rules or self.default_rules]
        self._state = TaskState()
        self.keep(*self._records())
        self._outputs: dict[str, Any] = {
            "events": (),
            "score": self.card(0),
            "progress": self._state.progress,
            "done": self._state.done,
        }
        return self._outputs

    def _check_names(self) -> None:
        """Raise ScenarioError if there are no such rules, or no metric of a benchmark."""
        _, metrics = make_metrics(self.params, Reader(self.params, frozenset()).watched)
        names = {value.name for metric in (*metrics, *self.more_metrics) for value in metric.values()}
        wanted = [("rules", i, name, RULES) for i, name in enumerate(self.params.rules)]
        wanted += [("benchmarks", name, name, names) for name in self.params.benchmarks]
        for part, key, name, known in wanted:
            if name not in known:
                what = "rules" if part == "rules" else "metric"
                raise ScenarioError(
                    f"unknown {what} '{name}'.{did_you_mean(name, known)}",
                    path=("participants", self.name, part, key),
                )

    def _records(self) -> Iterator[Record]:
        yield from (self._state, self._smoothing.state, self._events.state)
        if self._legs is not None:
            yield self._legs.state
        for metric in self._metrics:
            yield metric.state
        for rules in self._rules:
            yield from rules.records()

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Watch the events until `t + h`."""
        now, state = self._now, self._state
        self._reader.read(inputs, now)
        self.observe(inputs, now)
        now.time_s = (t + h) / 1e9
        if not state.begun:
            state.begun = True
            self._events.start(now)
        self._smoothing.update(now)
        events = (*self._events.observe(now), *self.more_events(now))
        if not state.done[0]:
            for metric in self._metrics:
                metric.update(now, events)
            self._reach(events)
        for rules in self._rules:
            rules.update(now, events)
        self._outputs["events"] = tuple(self._message(event, t + h) for event in events)
        if not (t + h) % self.params.card_period:
            self._outputs["score"] = self.card(t + h)
        return self._outputs

    def _reach(self, events: tuple[Event, ...]) -> None:
        """Count the reached goals."""
        state = self._state
        state.reached += sum(self.reaches(event) for event in events)
        if self._count:
            state.progress[0] = min(1.0, state.reached / self._count)
            if state.reached >= self._count:
                state.done[0] = 1.0
                self._time.finish()

    def _message(self, event: Event, time_ns: int) -> TaskEvent:
        return TaskEvent(
            header=Header(stamp=Time.from_ns(time_ns), frame_id="world"),
            event=event.kind,
            object=self.things[event.thing] if event.thing >= 0 else "",
            arm=self._watched.arms[event.arm] if event.arm >= 0 else "",
            place=self._goals.places[event.place] if event.place >= 0 else "",
            value=event.value,
            unit=event.unit,
        )

    def card(self, time_ns: int) -> ScoreCard:
        """Return the present score card, at simulated time `time_ns`."""
        metrics: dict[str, ScoreValue] = {
            value.name: value for metric in self._metrics for value in metric.values()
        }
        return ScoreCard(
            header=Header(stamp=Time.from_ns(time_ns), frame_id="world"),
            task=self.name_of_kind,
            goals=self._count,
            reached=self._state.reached,
            metrics=list(metrics.values()),
            rules=[RuleScore(rules=rules.name, values=list(rules.values(metrics))) for rules in self._rules],
        )
