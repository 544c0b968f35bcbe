"""The rules of the Surgical Robotics Challenge 2021-2022: pose of the needle, one stitch, four stitches.

Source: surgical-robotics-ai/surgical_robotics_challenge, scripts/surgical_robotics_challenge/evaluation, with
different demands of script and page: the script asks only for the order of the holes, the page also for the
distance of the needle from their middles, and for the length out of the tissue.

A stitch is reported by the competitor; without a source for `report` a valid stitch counts as reported with
the needle as far out as the page demands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np

from hub.participant import Record, array, flag, integer, number
from robots import rotation
from schemas.trocar_msgs import ScoreValue
from schemas.vectors import Vector
from tasks.events import Event
from tasks.instant import Instant
from tasks.rules.rules import Rules, Setting, Suture, missing_all

__all__ = ["Src1", "Src2Rules", "Src2Script", "Src3Rules", "Src3Script"]

_NEAR = 5.0e-3
"""Box about a hole's frame for counted samples of the tip, m."""
_ACROSS, _OUT = 2.5e-3, 5.0e-3
"""Limits of the page: largest distance across a hole, and least length out of the tissue, m."""
_LIMIT = 60.0
"""s, for the pose of the needle."""
_NO_SUTURE = "these rules score a needle in a phantom: run or record a task of kind suturing-task"


class Src1State(Record):
    """The last estimate after the start value."""

    error = number(-1.0)
    """m; -1: none yet."""
    time = number()


class Src1(Rules[Src1State]):
    """Challenge 1: the sum of the errors of base, mid and tip of the needle at the reported pose."""

    name: ClassVar[str] = "src1"
    _units: ClassVar[Mapping[str, str]] = {"error": "m", "in_time": "", "in_view": ""}

    def __init__(self, setting: Setting) -> None:
        self.state = Src1State()
        self._suture = setting.suture
        self._seen = False

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Compare the newest estimate with where the needle is, within the time."""
        suture = self._suture
        if suture is None or not suture.estimated or now.time_s > _LIMIT:
            return
        marks, true = suture.needle.marks, now.poses[suture.thing]
        off = _placed(marks, now.estimate) - _placed(marks, true)
        self.state.error = float(np.sqrt((off * off).sum(axis=1)).sum())
        self.state.time = now.time_s
        self._seen = bool(now.things_seen[suture.thing])

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:  # noqa: ARG002
        """Yield E, and whether the report was in time and with the needle in view."""
        if self._suture is None or not self._suture.estimated:
            reason = _NO_SUTURE if self._suture is None else "no estimate: connect a tracker to estimate/pose"
            yield from missing_all(self._units, reason)
            return
        yield ScoreValue(name="error", value=self.state.error, unit="m")
        yield ScoreValue(name="in_time", value=float(0.0 < self.state.time <= _LIMIT))
        yield ScoreValue(name="in_view", value=float(self._seen))


def _placed(marks: Vector, pose: Vector) -> Vector:
    return marks @ rotation.matrix(pose[3:]).T + pose[:3]


class InsertionsState(Record):
    """The tip's way through the holes; entries before exits."""

    before = array("holes")
    """Height of the tip over each hole at the last counted sample, m; 0: none."""
    order = array("holes")
    """Number of the last insertion of each hole; 0: none."""
    count = integer()
    across = array("holes", 2)
    """Position of the tip across each hole at the last insertion, m."""
    out = number()
    """How far the tip is out of the nearest hole, m."""
    nearest = integer(-1)


class StitchState(Record):
    """The report."""

    reported = flag()
    success = flag()
    time = number()
    out = number()
    across = array("pairs", 2)
    """Largest distance across entry and exit of each pair at the report, m."""
    lateral = array("pairs", 2)


class _Stitches(Rules[StitchState]):
    """Challenges 2 and 3: insertions in the right order."""

    _all: ClassVar[bool]
    """Whether all pairs of holes have to be stitched in turn."""
    _strict: ClassVar[bool]
    """Whether the page's limits hold."""
    _units: ClassVar[Mapping[str, str]] = {
        "success": "",
        "time": "s",
        "entry_lateral": "m",
        "exit_lateral": "m",
        "largest_across": "m",
        "axial": "m",
    }

    def __init__(self, setting: Setting) -> None:
        self._suture = setting.suture
        holes = 0 if setting.suture is None else len(setting.suture.holes)
        self._pairs = holes // 2
        self.state = StitchState(pairs=self._pairs)
        self._seen = InsertionsState(holes=holes)

    def records(self) -> Iterator[Record]:
        """Yield all parts of the state."""
        yield from (self.state, self._seen)

    def update(self, now: Instant, events: Sequence[Event]) -> None:  # noqa: ARG002
        """Follow the tip through the holes, and see whether a report counts."""
        if self._suture is None or self.state.reported:
            return
        self._follow(self._suture, now.poses[self._suture.thing])
        if now.reported if self._suture.asked else self._is_complete():
            self._report(now.time_s)

    def _follow(self, suture: Suture, pose: Vector) -> None:
        state = self._seen
        state.nearest, here = suture.tip.at(pose)
        state.out = float(here[state.nearest, 2])
        for i in np.flatnonzero((np.abs(here) <= _NEAR).all(axis=1)).tolist():
            was, height = float(state.before[i]), float(here[i, 2])
            goes_in = i < self._pairs
            if (was > 0.0 >= height) if goes_in else (was < 0.0 <= height):
                state.count += 1
                state.order[i], state.across[i] = state.count, here[i, :2]
            state.before[i] = height

    def _is_complete(self) -> bool:
        return self._counts() and self._seen.out >= _OUT

    def _counts(self) -> bool:
        """Say whether the holes have been passed in the right order."""
        state, pairs = self._seen, self._pairs
        if state.nearest < pairs:
            return False
        latest = [int(i) for i in np.argsort(-state.order, kind="stable") if state.order[i] > 0.0]
        if self._all:
            wanted = [hole for k in reversed(range(pairs)) for hole in (pairs + k, k)]
        else:
            wanted = [state.nearest, state.nearest - pairs]
        if latest[: len(wanted)] != wanted:
            return False
        across = np.abs(state.across[wanted]).max()
        return not self._strict or bool(across <= _ACROSS and state.out >= _OUT)

    def _report(self, time: float) -> None:
        state, seen = self.state, self._seen
        state.reported, state.success, state.time, state.out = True, self._counts(), time, seen.out
        for k in range(self._pairs):
            for side, hole in enumerate((k, self._pairs + k)):
                if seen.order[hole] > 0.0:
                    state.across[k, side] = float(np.abs(seen.across[hole]).max())
                    state.lateral[k, side] = float(np.hypot(*seen.across[hole]))

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:  # noqa: ARG002
        """Yield success, time, and the largest distances at entries and exits, of the reported stitches."""
        state = self.state
        if self._suture is None:
            yield from missing_all(self._units, _NO_SUTURE)
            return
        yield ScoreValue(name="success", value=float(state.success))
        rest = {name: unit for name, unit in self._units.items() if name != "success"}
        if not state.reported:
            yield from missing_all(rest, "nothing has been reported yet")
            return
        yield ScoreValue(name="time", value=state.time, unit="s")
        for side, name in enumerate(("entry_lateral", "exit_lateral")):
            yield ScoreValue(name=name, value=float(state.lateral[:, side].max()), unit="m")
        yield ScoreValue(name="largest_across", value=float(state.across.max()), unit="m")
        yield ScoreValue(name="axial", value=state.out, unit="m")


class Src2Script(_Stitches):
    """Challenge 2, a single stitch, by the script."""

    name: ClassVar[str] = "src2-script"
    _all: ClassVar[bool] = False
    _strict: ClassVar[bool] = False


class Src2Rules(_Stitches):
    """Challenge 2, a single stitch, by the page."""

    name: ClassVar[str] = "src2-rules"
    _all: ClassVar[bool] = False
    _strict: ClassVar[bool] = True


class Src3Script(_Stitches):
    """Challenge 3, all stitches in order, by the script."""

    name: ClassVar[str] = "src3-script"
    _all: ClassVar[bool] = True
    _strict: ClassVar[bool] = False


class Src3Rules(_Stitches):
    """Challenge 3, all stitches in order, by the page."""

    name: ClassVar[str] = "src3-rules"
    _all: ClassVar[bool] = True
    _strict: ClassVar[bool] = True
