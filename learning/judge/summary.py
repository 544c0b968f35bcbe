"""Results of a verdict by exercise and difficulty, computed from the rows of the trials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from learning.judge.episode import Row
from learning.judge.intervals import Rate, success_rate

__all__ = ["Result", "results_of"]


class Result(NamedTuple):
    """Trials of one exercise at one difficulty."""

    exercise: str
    difficulty: str
    rate: Rate
    time_s: float | None
    """Median time to success, s; None without a success."""
    path_m: float | None
    """Median path of all tips together in a success, m."""
    peak_force_n: float | None
    """Largest force of any tip in any trial, N; None where no force is measured."""
    drops: int
    phases: dict[str, int]
    """Number of trials that came to each kind of event, the most frequent first."""
    failures: dict[str, int]
    """Number of trials of each class of failure, the most frequent first."""


def results_of(rows: Sequence[Row]) -> list[Result]:
    """Return the results by exercise and difficulty, in the order of their first rows."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["exercise"], row["difficulty"]), []).append(row)
    return [_result(*key, group) for key, group in groups.items()]


def _result(exercise: str, difficulty: str, rows: Sequence[Row]) -> Result:
    successes = [row for row in rows if row["success"]]
    forces = [value for row in rows for value in _metrics(row, "peak_force")]
    return Result(
        exercise,
        difficulty,
        success_rate(len(successes), len(rows)),
        median(row["time_s"] for row in successes) if successes else None,
        median(sum(_metrics(row, "path_length")) for row in successes) if successes else None,
        max(forces, default=0.0) or None,  # of lean arms, forces are not measured and 0
        sum(row["counts"].get("dropped", 0) for row in rows),
        dict(Counter(kind for row in rows for kind in row["first"]).most_common()),
        dict(Counter(row["failure"] for row in rows if row["failure"]).most_common()),
    )


def _metrics(row: Row, name: str) -> list[float]:
    """Return the values of a metric, of all arms."""
    return [value for key, value in row["metrics"].items() if key.split(" ")[0].rpartition("/")[2] == name]
