"""Recorded inputs of a task, and a task stepped with recorded inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hub.participant import Inputs, Setup
from schemas.message import Message
from schemas.ports import Port
from schemas.trocar_msgs import ScoreCard, TaskEvent
from schemas.vectors import Vector, VectorCodec, has_vector
from tasks.task import Task

__all__ = ["Scored", "Stream", "score"]


@dataclass(frozen=True)
class Stream:
    """The recorded values of an input."""

    times_ns: NDArray[np.int64]
    """When each value held, shape (n,), ascending."""
    values: Any
    """The vectors, shape (n, size), or a list of messages."""
    ahead_ns: int
    """A step from `t` on reads the newest value until `t + ahead_ns`."""


class Scored(NamedTuple):
    """Score of a recording by a task."""

    card: ScoreCard
    events: list[TaskEvent]


def score(task: Task, streams: Mapping[str, Stream], period_ns: int) -> Scored:
    """Step `task` through the recorded values of the inputs, as in the session.

    Begins once every signal without a start value has a value; ends with the last value.
    """
    inputs_of = [port for port in task.ports if port.causality == "input"]
    values: dict[str, Any] = {port.name: _value_before(port) for port in inputs_of}
    names = [port.name for port in inputs_of if port.name in streams and len(streams[port.name].times_ns)]
    known = {name: streams[name] for name in names}
    needed = [port.name for port in inputs_of if port.variability != "event" and port.start is None]
    begin_ns = max((int(known[name].times_ns[0]) for name in needed if name in known), default=0)
    begin_ns = begin_ns // period_ns * period_ns
    end_ns = max((int(stream.times_ns[-1]) for stream in known.values()), default=0)
    queues = {port.name for port in inputs_of if port.variability == "event"}
    arrived: dict[str, tuple[Message, ...]] = {}
    places, inputs, events = dict.fromkeys(known, 0), Inputs(values, events=arrived), list[TaskEvent]()
    connected = known.keys() | (queues & streams.keys())  # a queue without a message is connected too
    outputs = task.configure(Setup(period_ns, Path(), connected=frozenset(connected)))
    for t in range(begin_ns, end_ns - period_ns + 1, period_ns):
        for name, stream in known.items():
            first = places[name]
            # the values until then, of which the last holds
            places[name] = int(np.searchsorted(stream.times_ns, t + stream.ahead_ns, side="right"))
            if name in queues:
                arrived[name] = tuple(stream.values[first : places[name]])
            elif places[name]:
                values[name] = stream.values[places[name] - 1]
        outputs = task.step(t - begin_ns, period_ns, inputs)
        events += cast("tuple[TaskEvent, ...]", outputs["events"])
    return Scored(cast("ScoreCard", outputs["score"]), events)


def _value_before(port: Port) -> Vector | None:
    """Return the value of an input before the first recorded one; None: a message without a vector form."""
    if not has_vector(port.type):
        return None
    return VectorCodec(port).neutral if port.start is None else np.array(port.start)
