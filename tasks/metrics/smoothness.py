"""How smooth the movements of the tips are. Definitions and sources: docs/scores.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi, sqrt

import numpy as np

from hub.participant import Record, array
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.instant import Instant
from tasks.metrics.metric import Metric, missing

__all__ = ["FREQUENCIES", "Smoothness", "spectral_arc_length"]

FREQUENCIES = np.linspace(0.0, 10.0, 201)
"""Frequencies of a speed's spectrum, Hz. A movement of 10 s has lobes of 0.1 Hz."""
_THRESHOLD = 0.05
"""Fraction of the spectrum at 0 Hz; the spectrum ends at the last frequency above this fraction."""
_SHORTEST, _LONGEST = 0.2, 10.0
"""s; a longer movement is cut."""
_EDGE = 0.1
"""Fraction of the idle speed at the beginning and the end of a movement, with most of the jerk."""
_NEAREST = 1e-3
"""m; a shorter movement is none."""


def spectral_arc_length(spectrum: Vector) -> float:
    """Return the spectral arc length of a speed from the `spectrum` at `FREQUENCIES`, complex, shape (201,).

    Balasubramanian, Melendez-Calderon, Roby-Brami and Burdet, "On the analysis of movement smoothness",
    Journal of NeuroEngineering and Rehabilitation 12 (2015), with the paper's largest frequency, 10 Hz, and
    threshold, 0.05.
    """
    magnitude = np.abs(spectrum)
    magnitude = magnitude / magnitude[0]
    last = int(np.flatnonzero(magnitude >= _THRESHOLD)[-1])
    kept, frequencies = magnitude[: last + 1], FREQUENCIES[: last + 1]
    if last == 0:
        return 0.0
    return -float(np.hypot(np.diff(frequencies) / frequencies[-1], np.diff(kept)).sum())


class SmoothnessState(Record):
    """The present movement of each tip, and sums over finished movements."""

    time = array("arms")
    """Time since the movement began, s; 0: no movement."""
    length = array("arms")
    peak = array("arms")
    """Peak of the speed, m/s."""
    jerk = array("arms")
    """Integral of the squared jerk, m^2/s^5."""
    real = array("arms", FREQUENCIES.size)
    imaginary = array("arms", FREQUENCIES.size)
    movements = array("arms")
    jerks = array("arms")
    arcs = array("arms")


class Smoothness(Metric[SmoothnessState]):
    """Mean normalised jerk and spectral arc length over the movements of each tip.

    A movement lasts while the tip is faster than a tenth of the idle speed, and counts if the tip was not
    idle throughout.
    """

    def __init__(self, arms: Sequence[str], idle_speed: float) -> None:
        """Measure `arms`; below `idle_speed` (m/s) a tip is idle."""
        self.state = SmoothnessState(arms=len(arms))
        self._arms, self._least, self._edge = arms, idle_speed, _EDGE * idle_speed

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add a period to present movements, and end finished movements."""
        if not now.is_smooth:
            return
        for i, speed in enumerate(now.speeds):
            if speed >= self._edge:
                self._go_on(i, speed, now)
            if self.state.time[i] and (speed < self._edge or self.state.time[i] >= _LONGEST):
                self._end(i)

    def _go_on(self, i: int, speed: float, now: Instant) -> None:
        state, period = self.state, now.period_s
        phase = 2.0 * pi * state.time[i] * FREQUENCIES
        state.real[i] += speed * period * np.cos(phase)
        state.imaginary[i] -= speed * period * np.sin(phase)
        state.time[i] += period
        state.length[i] += speed * period
        state.peak[i] = max(float(state.peak[i]), speed)
        state.jerk[i] += period * float(now.jerks[i] @ now.jerks[i])

    def _end(self, i: int) -> None:
        state = self.state
        time, length = float(state.time[i]), float(state.length[i])
        if time >= _SHORTEST and length >= _NEAREST and state.peak[i] >= self._least:
            state.movements[i] += 1.0
            state.jerks[i] += sqrt(0.5 * float(state.jerk[i]) * time**5) / length
            state.arcs[i] += spectral_arc_length(state.real[i] + 1j * state.imaginary[i])
        for part in (state.time, state.length, state.peak, state.jerk, state.real, state.imaginary):
            part[i] = 0.0

    def values(self) -> Iterator[ScoreValue]:
        """Yield the means."""
        state = self.state
        for name, sums in ("normalised_jerk", state.jerks), ("spectral_arc_length", state.arcs):
            for arm, total, count in zip(self._arms, sums.tolist(), state.movements.tolist(), strict=True):
                if count:
                    yield ScoreValue(name=f"{arm}/{name}", value=total / count)
                else:
                    yield missing(f"{arm}/{name}", "", "no movement has ended")
