"""Trials without a session: tips that go along given paths, objects that are put here and there."""

import numpy as np

from tasks.events import Event
from tasks.instant import Instant
from tasks.metrics.smoothing import Smoothing

PERIOD_S = 0.01


def minimum_jerk(duration_s, length_m, *, rest_s=0.5, period_s=PERIOD_S):
    """Return positions along x, m, shape (n, 3), of a movement between two rests.

    x = L (10 tau^3 - 15 tau^4 + 6 tau^5), Flash and Hogan (1985).
    """
    tau = np.clip((np.arange(0.0, duration_s + 2 * rest_s, period_s) - rest_s) / duration_s, 0.0, 1.0)
    x = length_m * (10 * tau**3 - 15 * tau**4 + 6 * tau**5)
    return np.column_stack([x, np.zeros((len(x), 2))])


def measured(metric, tips, *, turns=None, events=(), period_s=PERIOD_S):
    """Return the numbers of `metric` by name after one tip has gone along `tips`, m, shape (n, 3).

    `events` are (index of the instant, event).
    """
    now = Instant(1, 0, period_s=period_s)
    smoothing = Smoothing(1, period_s)
    for i, tip in enumerate(tips):
        now.time_s = (i + 1) * period_s
        now.tips[0] = tip
        now.turns[0] = (0.0, 0.0, 0.0, 1.0) if turns is None else turns[i]
        smoothing.update(now)
        metric.update(now, [event for at, event in events if at == i])
    return {value.name: None if value.reason else value.value for value in metric.values()}


def grasp(thing=0, arm=0):
    return Event("grasped", thing, arm)


def hand(thing=0, arm=1):
    return Event("handed over", thing, arm)


def place(thing, at, arm=1):
    return Event("placed", thing, arm, at)
