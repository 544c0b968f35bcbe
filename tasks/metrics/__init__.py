"""Metrics of skill, measured in any trial under any rules."""

from __future__ import annotations

from tasks.instant import Watched
from tasks.metrics.counts import Clutching, Counts, Time
from tasks.metrics.errors import Collisions, FixtureCollisions, Forces, View
from tasks.metrics.metric import AnyMetric
from tasks.metrics.motion import Economy, Paths, Turning, WorkingVolume
from tasks.metrics.smoothness import Smoothness
from tasks.params import TaskParams

__all__ = ["make_metrics"]


def make_metrics(params: TaskParams, watched: Watched) -> tuple[Time, tuple[AnyMetric, ...]]:
    """Return the clock of the trial, and all metrics (clock included), in the order of the score card."""
    arms, time = watched.arms, Time()
    return time, (
        time,
        Counts(len(watched.things)),
        Collisions(watched),
        *([] if watched.fixtures is None else [FixtureCollisions(watched)]),
        Forces(watched, params.force_limit),
        View(watched),
        Clutching(watched),
        Paths(arms, params.idle_speed),
        Economy(arms),
        WorkingVolume(arms),
        Turning(arms),
        Smoothness(arms, params.idle_speed),
    )
