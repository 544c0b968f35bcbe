"""The course of an episode, as its environment tells."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from learning.environments.environment import Environment

__all__ = ["Happened"]


class Happened:
    """Steps, events and end of an episode.

    Attributes:
        steps: steps so far.
        succeeded: whether the goal is reached.
        lost: whether an object has fallen out of the scene.
        first: time of the first event of each kind, s.
        last: time of the last event of each kind, s.
        counts: number of events of each kind.
    """

    def __init__(self, env: Environment) -> None:
        self._env = env
        self.steps, self.succeeded, self.lost = 0, False, False
        self.first: dict[str, float] = {}
        self.last: dict[str, float] = {}
        self.counts: Counter[str] = Counter()

    def see_step(self, info: dict[str, Any]) -> None:
        """Take notice of a step."""
        self.steps += 1
        for event in self._env.events:
            time = event.header.stamp.ns / 1e9
            self.first.setdefault(event.event, time)
            self.last[event.event] = time
            self.counts[event.event] += 1
        self.succeeded = bool(info["is_success"])
        self.lost = self._env.has_lost_object

    @property
    def time_s(self) -> float:
        """Simulated time since the reset, s."""
        return self._env.time_s

    @property
    def distance(self) -> float:
        """Distance of the achieved from the desired goal: m, or the unit of the exercise's goal."""
        achieved, desired = self._env.goals
        return float(np.linalg.norm(achieved - desired))

    def metrics(self) -> dict[str, float]:
        """Return the valid metrics of the task's score card, by name and unit."""
        card = self._env.exercise.task.card(round(self.time_s * 1e9))
        return {
            f"{value.name} ({value.unit})" if value.unit else value.name: value.value
            for value in card.metrics
            if not value.reason and np.isfinite(value.value)
        }
