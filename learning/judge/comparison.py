"""Two verdicts side by side: trials of the same exercise, difficulty and seed are pairs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from learning.judge.episode import Row, Trial
from learning.judge.intervals import PairedDifference, paired_difference
from learning.judge.verdict import read_verdict
from schemas.errors import ScenarioError

__all__ = ["Comparison", "compare", "comparison_text"]


class Comparison(NamedTuple):
    """Difference of two policies in one exercise at one difficulty."""

    exercise: str
    difficulty: str
    first: int
    """Successes of the first policy."""
    second: int
    difference: PairedDifference


def compare(first: Path, second: Path) -> list[Comparison]:
    """Return the comparisons of all that both verdicts judge; the last one is over all pairs.

    Raises ScenarioError if a directory holds no verdict, or if the two share no trial.
    """
    rows = [_by_trial(read_verdict(place)) for place in (first, second)]
    shared = [trial for trial in rows[0] if trial in rows[1]]
    if not shared:
        raise ScenarioError(
            f"'{first}' and '{second}' share no trial: judge both policies on the same suite,"
            " difficulties and seeds"
        )
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in shared:
        groups.setdefault((trial.exercise, trial.difficulty), []).append(trial)
    found = [_compare(*key, trials, *rows) for key, trials in groups.items()]
    return found if len(found) == 1 else [*found, _compare("all", "all", shared, *rows)]


def _by_trial(rows: Iterable[Row]) -> dict[Trial, bool]:
    return {Trial(row["exercise"], row["difficulty"], row["seed"]): row["success"] for row in rows}


def _compare(
    exercise: str,
    difficulty: str,
    trials: Sequence[Trial],
    first: dict[Trial, bool],
    second: dict[Trial, bool],
) -> Comparison:
    ours, theirs = ([rows[trial] for trial in trials] for rows in (first, second))
    return Comparison(exercise, difficulty, sum(ours), sum(theirs), paired_difference(ours, theirs))


def comparison_text(found: Comparison) -> str:
    """Return a sentence about a comparison."""
    difference = found.difference
    verdict = "the difference is real" if difference.is_real else "no difference is shown"
    return (
        f"{found.exercise}, {found.difficulty}: {found.first} and {found.second} of {difference.pairs},"
        f" difference {difference.difference:+.2f} ({difference.low:+.2f} to {difference.high:+.2f}),"
        f" {difference.only_first} only the first, {difference.only_second} only the second,"
        f" p = {difference.p:.2g}: {verdict}"
    )
