"""Metrics of the endoscope and of both hands: moves of the camera, time with both hands at work."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hub.participant import Record, array, flag, integer, number
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.instant import Instant
from tasks.metrics.metric import NO_CAMERA, Metric, missing

__all__ = ["BothHands", "CameraMoves"]

_REST = 0.2
"""Time at rest between two moves of the endoscope, s."""


class CameraMovesState(Record):
    """Way of the endoscope."""

    before = array(3)
    """Position in the arm's base at the last instant, m."""
    begun = flag()
    length = number()
    """m."""
    moves = integer()
    rest = number(_REST)
    """Time since the endoscope moved, s."""


class CameraMoves(Metric[CameraMovesState]):
    """Number of moves and path of the endoscope."""

    def __init__(self, idle_speed: float) -> None:
        """Below `idle_speed` (m/s) the endoscope rests."""
        self.state = CameraMovesState()
        self.position: Vector = np.zeros(3)
        """Present position in the arm's base, m, to be written before each update."""
        self.is_known = False
        """Whether the endoscope's pose is connected."""
        self._idle_speed = idle_speed

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add the path of a period."""
        state = self.state
        if not self.is_known:
            return
        step = float(np.linalg.norm(self.position - state.before)) if state.begun else 0.0
        state.before[:], state.begun = self.position, True
        if step > self._idle_speed * now.period_s:
            state.moves += state.rest >= _REST
            state.length, state.rest = state.length + step, 0.0
        else:
            state.rest += now.period_s

    def values(self) -> Iterator[ScoreValue]:
        """Yield number and path (m)."""
        for name, value, unit in (
            ("camera_moves", float(self.state.moves), ""),
            ("camera_path_length", self.state.length, "m"),
        ):
            if self.is_known:
                yield ScoreValue(name=name, value=value, unit=unit)
            else:
                yield missing(name, unit, NO_CAMERA)


class BothHandsState(Record):
    """Times of both hands."""

    both = number()
    """Time with two or more tips in motion, s."""
    any = number()
    """Time with a tip in motion, s."""


class BothHands(Metric[BothHandsState]):
    """Share of the time with motion in which two tips or more move."""

    def __init__(self, arms: int, idle_speed: float) -> None:
        """Below `idle_speed` (m/s) a tip is idle."""
        self.state = BothHandsState()
        self._arms, self._idle_speed = arms, idle_speed

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Add a period."""
        moving = sum(speed >= self._idle_speed for speed in now.speeds) if now.is_smooth else 0
        self.state.both += now.period_s * (moving > 1)
        self.state.any += now.period_s * (moving > 0)

    def values(self) -> Iterator[ScoreValue]:
        """Yield the share."""
        if self._arms < 2:
            yield missing("both_hands_share", "", "the scene has a single arm with an instrument")
        elif not self.state.any:
            yield missing("both_hands_share", "", "no tip has moved")
        else:
            yield ScoreValue(name="both_hands_share", value=self.state.both / self.state.any)
