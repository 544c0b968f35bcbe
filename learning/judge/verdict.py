"""A verdict and its directory: the trials of a policy, each a row and a recording.

    DIR/.trocar                        marks the directory; locked while a judge is at work
    DIR/verdict.json                   policy, exercises, difficulties, seeds, versions
    DIR/trials/NAME.json               the row of a finished trial
    DIR/trials/NAME/                   its recording
    DIR/trials.parquet, index.html     table and page, written anew after each run

A trial is done when its row stands there: the same command goes on with an interrupted trial.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any, cast

from learning.judge.episode import Row, Trial, judge_trial, make_environment
from learning.judge.operation_trial import judge_operation
from learning.judge.operations import OPERATIONS
from learning.judge.policies import PolicyAddress, open_policy
from learning.own_directory import MARKER, whole_file
from learning.workers import run_calls
from schemas.errors import ScenarioError

__all__ = ["Verdict", "judge_trials", "read_verdict"]

_AT_ONCE = 10
"""Trials per call of a worker: an environment is made once, and an interruption loses a few seconds."""


@dataclass(frozen=True)
class Verdict:
    """The trials of a policy, and the directory of the results."""

    policy: PolicyAddress
    exercises: tuple[str, ...]
    difficulties: tuple[str, ...]
    seeds: int
    """Number of episodes of each exercise at each difficulty."""
    directory: Path
    first_seed: int = 0
    recorded: bool = True

    @property
    def trials(self) -> list[Trial]:
        """All trials, in order."""
        return [
            Trial(exercise, difficulty, seed)
            for exercise in self.exercises
            for difficulty in self.difficulties
            for seed in range(self.first_seed, self.first_seed + self.seeds)
        ]

    def open(self) -> None:
        """Begin in the directory, or go on there; the caller has claimed the directory.

        Raises ScenarioError if the directory holds another verdict or something else.
        """
        file, described = self.directory / "verdict.json", self.description
        if file.exists():
            if (there := _read(file)) != described:
                changed = [key for key in described if there.get(key) != described[key]]
                raise ScenarioError(
                    f"'{self.directory}' holds another verdict (other {', '.join(changed)}): name a new"
                    " directory, or repeat the command that began it"
                )
            return
        if any(path.name not in (MARKER, "trials") for path in self.directory.iterdir()):
            raise ScenarioError(
                f"'{self.directory}' holds something else than a verdict: name a new directory"
            )
        (self.directory / "trials").mkdir(parents=True, exist_ok=True)
        _write(file, described)

    def pending(self) -> list[Trial]:
        """Return the trials not done yet."""
        return [trial for trial in self.trials if not self._row_file(trial).exists()]

    def rows(self) -> list[Row]:
        """Return the rows of all finished trials, in order."""
        return [_read(file) for trial in self.trials if (file := self._row_file(trial)).exists()]

    def run(self, jobs: int, *, ray: str | None = None) -> Iterator[Row]:
        """Run the pending trials, `jobs` at a time or on a Ray cluster, and yield the rows once written."""
        place = str(self.directory.resolve() / "trials") if self.recorded else None
        calls = [(self.policy, group, place) for group in _groups(self.pending())]
        for _, rows in run_calls(judge_trials, calls, jobs, ray=ray):
            for row in rows:
                trial = Trial(row["exercise"], row["difficulty"], row["seed"])
                _write(self._row_file(trial), row)
                yield row

    @property
    def description(self) -> dict[str, Any]:
        """Settings of the verdict, and the version of Trocar."""
        return {
            "policy": self.policy.name,
            "contract": self.policy.contract,
            "execute": self.policy.execute,
            "exercises": list(self.exercises),
            "difficulties": list(self.difficulties),
            "seeds": self.seeds,
            "first_seed": self.first_seed,
            "recorded": self.recorded,
            "trocar": version("trocar"),
        }

    def _row_file(self, trial: Trial) -> Path:
        return self.directory / "trials" / f"{trial.name}.json"


def judge_trials(policy: PolicyAddress, trials: Sequence[Trial], directory: str | None) -> list[Row]:
    """Return the rows of some trials of one exercise; recordings go below `directory`."""
    if trials[0].exercise in OPERATIONS:
        places = [Path(directory) / trial.name if directory else None for trial in trials]
        return [judge_operation(policy, *each) for each in zip(trials, places, strict=True)]
    judged = open_policy(policy)
    rows: list[Row] = []
    with ExitStack() as held, ExitStack() as stack:
        if isinstance(judged, AbstractContextManager):
            held.enter_context(judged)
        env, world = None, None
        for trial in trials:
            if env is None or world != trial.world:
                stack.close()
                env, world = make_environment(trial, judged.environment), trial.world
                stack.callback(env.close)
            recording = Path(directory) / trial.name if directory else None
            if recording is not None:
                shutil.rmtree(recording, ignore_errors=True)  # of a judge that was interrupted
            rows.append(judge_trial(env, judged, trial, recording))
    return rows


def read_verdict(directory: Path) -> list[Row]:
    """Return the rows of the finished trials in the directory of a verdict, by name.

    Raises ScenarioError if there are none, or a damaged row.
    """
    rows = [_read(file) for file in sorted((directory / "trials").glob("*.json"))]
    if not (directory / "verdict.json").is_file() or not rows:
        raise ScenarioError(f"'{directory}' holds no verdict with a finished trial: see `trocar judge`")
    if any(not {"exercise", "difficulty", "seed", "success"} <= row.keys() for row in rows):
        raise ScenarioError(f"'{directory}' holds rows that are none of a verdict")
    return rows


def _groups(trials: Sequence[Trial]) -> Iterator[list[Trial]]:
    """Yield the trials of each exercise and difficulty, some at a time."""
    for (exercise, _), alike in groupby(trials, lambda trial: (trial.exercise, trial.difficulty)):
        group = list(alike)
        at_once = 1 if exercise in OPERATIONS else _AT_ONCE
        for first in range(0, len(group), at_once):
            yield group[first : first + at_once]


def _read(file: Path) -> dict[str, Any]:
    """Return the JSON object in a file of a verdict. Raises ScenarioError if there is none."""
    try:
        found: Any = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ScenarioError(f"'{file}' cannot be read ({error}): delete the file to judge anew") from error
    if not isinstance(found, dict):
        raise ScenarioError(f"'{file}' holds no JSON object: delete the file to judge anew")
    return cast("dict[str, Any]", found)


def _write(file: Path, content: Mapping[str, Any]) -> None:
    """Write a file in a single piece."""
    with whole_file(file) as part:
        part.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
