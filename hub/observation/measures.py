"""Measures, score cards and warnings: the summary's values of output ports during the run."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from math import inf, sqrt
from typing import Any

import numpy as np

from hub.observation.contact_watch import ContactWatch
from hub.planning.measured import measured_port
from hub.planning.plan import Plan
from schemas.ros import DiagnosticStatus, Float64Message
from schemas.scenario import Measure, Scenario
from schemas.trocar_msgs import ScoreCard
from schemas.vectors import Vector

__all__ = ["Measures"]

_KEPT = (ScoreCard.ros_type, DiagnosticStatus.ros_type)
"""Types of messages of which the newest counts."""


class _Meter:
    """A measure: running statistics of a part of a vector."""

    def __init__(self, measure: Measure, part: slice, period: float) -> None:
        self.live = measure.live
        self.unit = measure.unit
        self._of = measure.of
        self.now: float | None = None
        self._kind = measure.kind
        self._part = part
        self._after = measure.after
        self._peak: float | None = None
        self._least = inf
        size = part.stop - part.start
        self._is_norm = measure.kind == "peak-norm" or size > 1
        self._low: Vector = np.full(size, inf)
        self._high: Vector = np.full(size, -inf)
        self._drop = 0.0
        self._level, self._period = measure.level, period
        self._above = self._longest = 0
        self._sum = 0.0
        self._count = 0

    def add(self, value: Vector, time_ns: int) -> None:
        part = value[self._part]
        # what np.linalg.norm does for a vector, at a fifth of its cost
        self.now = now = sqrt(part.dot(part)) if self._is_norm else float(part[0])
        if time_ns < self._after:
            return
        if now < self._least:
            self._least = now
        if self._kind == "swing":
            self._low, self._high = np.minimum(self._low, part), np.maximum(self._high, part)
        if self._peak is None or now > self._peak:
            self._peak, self._drop = now, 0.0
        elif self._peak - now > self._drop:
            self._drop = self._peak - now
        if self._level is not None:
            self._above = self._above + 1 if now >= self._level else 0
            self._longest = max(self._longest, self._above)
        self._sum += now
        self._count += 1

    @property
    def result(self) -> float | None:
        if not self._count:
            return None
        results = {
            "peak-norm": self._peak,
            "peak": self._peak,
            "least": self._least,
            "mean": self._sum / self._count,
            "final": self.now,
            "drop": self._drop,
            "swing": float(np.max(self._high - self._low)),
            "time-above": self._longest * self._period,
        }
        return results[self._kind]

    @property
    def missing(self) -> str:
        """Why there is no result; empty if there is one."""
        if self._count:
            return ""
        since = f" after {self._after / 1e9:g} s" if self.now is not None else ""
        return f"'{self._of}' published no value{since}"


class Measures:
    """All measures of a session; the values of a port must arrive in order."""

    def __init__(self, scenario: Scenario, plan: Plan) -> None:
        self._meters: dict[str, _Meter] = {}
        self.by_port: dict[tuple[str, str], list[_Meter | ContactWatch]] = {
            (planned.name, port.name): []
            for planned in plan.participants.values()
            for port in planned.ports
            if port.causality == "output" and port.type in _KEPT and planned.role != "device"
        }
        self._warnings: dict[str, str] = {}
        self._cards: dict[str, ScoreCard] = {}
        self._lock = threading.Lock()
        for name, measure in scenario.measure.items():
            planned = plan.participants[measure.of.participant]
            port, part = measured_port(planned, measure.of.port)
            period = 1e-9 * (planned.read_ns or plan.step_ns * plan.output_stride(planned.name, port.name))
            meter = self._meters[name] = _Meter(measure, part, period)
            self.by_port.setdefault((measure.of.participant, port.name), []).append(meter)

    def watch(self, watch: ContactWatch) -> None:
        """Give `watch` every pose of its tool's tip."""
        self.by_port.setdefault(watch.port, []).append(watch)

    @property
    def ports(self) -> list[tuple[str, str]]:
        """The measured (participant, port) pairs, including score cards and diagnoses."""
        return list(self.by_port)

    @property
    def score_cards(self) -> dict[str, ScoreCard]:
        """The newest score card of each participant with published cards."""
        return dict(self._cards)

    @property
    def warnings(self) -> dict[str, str]:
        """What each stepped participant could not do as asked, by its last diagnosis."""
        return dict(self._warnings)

    def add(self, participant: str, port: str, value: Any, time_ns: int) -> None:
        """Add the value of a signal port, or a message of an event port, at a time."""
        if isinstance(value, ScoreCard):
            self._cards[participant] = value
            return
        if isinstance(value, DiagnosticStatus):
            self._warnings.pop(participant, None)
            if value.level:
                self._warnings[participant] = value.message
            return
        if isinstance(value, Float64Message):
            value = np.array([value.data])
        for meter in self.by_port.get((participant, port), ()):
            with self._lock:
                meter.add(value, time_ns)

    def live(self) -> Mapping[str, tuple[float, str]]:
        """Return the current value and unit of each measure of the progress line with a value."""
        return {
            name: (meter.now, meter.unit)
            for name, meter in self._meters.items()
            if meter.live and meter.now is not None
        }

    def results(self) -> dict[str, float | None]:
        """Return the result of every measure; None if the port had no value."""
        return {name: meter.result for name, meter in self._meters.items()}

    def missing(self) -> dict[str, str]:
        """Return why each measure without a result has none."""
        return {name: meter.missing for name, meter in self._meters.items() if meter.missing}
