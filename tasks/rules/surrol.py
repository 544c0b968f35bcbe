"""The success of SurRoL's environments.

Source: med-air/SurRoL at a903fa6, surrol/tasks: 50 steps of 0.2 s an episode; at the end of a step an object
is at its goal within 5 mm, on a peg within 5 mm across and 4 mm along the peg. (All lengths of SurRoL are 5
times as large, like the whole world.)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np

from hub.participant import Record, array, integer, number
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.instant import Instant
from tasks.rules.rules import Rules, Setting, missing_all

__all__ = ["Surrol"]

_STEP = 0.2
"""s."""
_STEPS = 50
_TOLERANCE = 5e-3
"""Tolerance of a distance, m; on a peg, of the distance across the peg."""
_ALONG_PEG = 4e-3
"""m."""
_UNITS = {"success": "", "success_at_end": "", "reached": "", "first_success": "s"}


class SurrolState(Record):
    """At the end of the last step."""

    steps = integer()
    reached = array("objects")
    """1 for each object at its goal."""
    first = number(-1.0)
    """When all objects first were, s; -1: never."""


class Surrol(Rules[SurrolState]):
    """SurRoL's success, for all objects instead of a single object."""

    name: ClassVar[str] = "surrol"

    def __init__(self, setting: Setting) -> None:
        goals = setting.goals
        self.state = SurrolState(objects=len(setting.things))
        self._board = setting.is_board
        self._goals: list[Vector] = []
        if goals.positions is not None:
            self._goals = [goals.positions[sorted(targets)] for targets in goals.targets]

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """At the end of a step, find the objects at their goals."""
        state = self.state
        if not self._goals or now.time_s < (state.steps + 1) * _STEP - 0.5 * now.period_s:
            return
        state.steps += 1
        for i, (pose, goals) in enumerate(zip(now.poses, self._goals, strict=True)):
            state.reached[i] = self._is_there(pose[:3], goals)
        if state.first < 0.0 and state.reached.all():
            state.first = now.time_s

    def _is_there(self, position: Vector, goals: Vector) -> bool:
        away = position - goals
        if self._board:
            across, along = np.hypot(away[:, 0], away[:, 1]), np.abs(away[:, 2])
            return bool(((across < _TOLERANCE) & (along < _ALONG_PEG)).any())
        return bool((np.linalg.norm(away, axis=1) < _TOLERANCE).any())

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:  # noqa: ARG002
        """Yield success within 50 steps, success now, objects at their goals, and the first success."""
        if not self._goals:
            yield from missing_all(_UNITS, "the task has no goals with positions, from which distances count")
            return
        state = self.state
        in_time = 0.0 <= state.first <= _STEPS * _STEP + 1e-9
        yield ScoreValue(name="success", value=float(in_time))
        yield ScoreValue(name="success_at_end", value=float(bool(state.reached.all())))
        yield ScoreValue(name="reached", value=float(state.reached.sum()))
        if state.first < 0.0:
            yield ScoreValue(name="first_success", unit="s", reason="not all objects were where they belong")
        else:
            yield ScoreValue(name="first_success", value=state.first, unit="s")
