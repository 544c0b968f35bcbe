"""The doublet score of the critical view of safety: three criteria of 0 to 2 points each.

Source: Sanford and Strasberg, J. Am. Coll. Surg. 218 (2014): two photographs, front and back, 5 points or
more are satisfactory. Raters give a point for a criterion that is met in part; here that is from half on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from hub.participant import Record
from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.instant import Instant
from tasks.rules.operation_errors import NO_OPERATION
from tasks.rules.rules import Rules, Setting, missing_all

__all__ = ["CvsDoublet"]

_WHOLE, _PART = 0.9, 0.5
_SATISFACTORY = 5.0
_ROWS = {"two_structures": "", "triangle": "", "plate": "", "total": "", "satisfactory": ""}


class CvsState(Record):
    """Nothing: the metrics have all."""


class CvsDoublet(Rules[CvsState]):
    """Points by the metrics `cvs/...`: before the first clip."""

    name: ClassVar[str] = "cvs-doublet"

    def __init__(self, setting: Setting) -> None:  # noqa: ARG002
        self.state = CvsState()

    def update(self, now: Instant, events: Sequence[Event]) -> None:
        """Do nothing: the metrics take all."""

    def values(self, metrics: Mapping[str, ScoreValue]) -> Iterator[ScoreValue]:
        """Yield the points of each criterion, their sum, and whether it is satisfactory."""
        if "cvs/structures" not in metrics:
            yield from missing_all(_ROWS, NO_OPERATION)
            return
        parts = [metrics[f"cvs/{name}"] for name in ("structures", "triangle_cleared", "plate_freed")]
        points = [2.0 * (parts[0].value == 2.0), *(_points(part.value) for part in parts[1:])]
        for name, part, found in zip(_ROWS, parts, points, strict=False):
            yield ScoreValue(name=name, value=0.0 if part.reason else found, reason=part.reason)
        reason = next((part.reason for part in parts if part.reason), "")
        total = 0.0 if reason else sum(points)
        yield ScoreValue(name="total", value=total, reason=reason)
        yield ScoreValue(name="satisfactory", value=float(total >= _SATISFACTORY), reason=reason)


def _points(share: float) -> float:
    return float(share >= _PART) + (share >= _WHOLE)
