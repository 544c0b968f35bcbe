"""A sweep and its directory: finished trials and their results.

    DIR/.trocar                 marks a sweep's directory; locked while the sweep runs
    DIR/sweep.json              the settings of the sweep; until all is written, sweep.part
    DIR/trials/00007.json       the row of a finished trial
    DIR/trials/00007/           its recording
    DIR/results.parquet, .png   the table and its plots, written anew after each run

A trial counts as done when its row stands there, written in a single piece: an interrupted sweep, however
ended, goes on where it stopped.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import trocar
from learning.own_directory import MARKER, whole_file
from learning.sweeps.trial import Trial, plan_trials, run_trial
from learning.sweeps.variation import Variation
from learning.workers import run_calls
from schemas.errors import ScenarioError

__all__ = ["Sweep"]

_Call = tuple[str, list[str], str | None]
"""The arguments of `run_trial`."""


@dataclass(frozen=True)
class Sweep:
    """The trials to run, and the directory of the results."""

    scenario: str
    """A name or a path, as for `trocar run`."""
    variations: tuple[Variation, ...]
    directory: Path
    repeat: int = 1
    seed: str | None = None
    """Path of a parameter set to the number of the repetition."""
    overrides: tuple[str, ...] = ()
    """Settings of every trial, as for `--set`."""
    recorded: bool = True

    @property
    def trials(self) -> list[Trial]:
        """All trials, in order."""
        return plan_trials(self.variations, self.repeat, self.seed)

    def check(self) -> None:
        """Raise ScenarioError if a parameter is varied twice, or if a value is not valid in the scenario."""
        paths = [variation.path for variation in self.variations] + ([self.seed] if self.seed else [])
        if twice := sorted({path for path in paths if paths.count(path) > 1}):
            raise ScenarioError(f"'{twice[0]}' is varied twice; give it one --vary with all its values")
        first = {variation.path: variation.values[0] for variation in self.variations}
        if self.seed:
            first[self.seed] = 0
        for variation in self.variations:
            for value in variation.values:
                trocar.load_scenario(
                    self.scenario,
                    set=self._fixed_settings() | _setting_texts(first | {variation.path: value}),
                )

    @cached_property
    def scenario_hash(self) -> str:
        """SHA-256 of the first trial's scenario, as loaded now; comments do not count.

        Raises ScenarioError if the scenario is not valid.
        """
        first = self._fixed_settings() | _setting_texts(self.trials[0].settings)
        scenario = trocar.load_scenario(self.scenario, set=first).scenario
        return hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()

    def open(self) -> None:
        """Begin in the directory, or go on with the sweep there; the caller has claimed the directory.

        Raises ScenarioError if the directory holds another sweep or something else, or if the scenario has
        changed.
        """
        file, described = self.directory / "sweep.json", self._describe_sweep()
        if file.exists():
            now, there = described.pop("scenario_hash"), _read(file)
            if there.pop("scenario_hash", now) != now and there == described:
                raise ScenarioError(
                    f"the scenario '{self.scenario}' has changed since the sweep in '{self.directory}' began,"
                    " so its trials would not be comparable: name a new directory, or undo the change"
                )
            if there != described:
                raise ScenarioError(
                    f"'{self.directory}' holds another sweep (see {file}): name a new directory, or repeat"
                    " the command that began it"
                )
            return
        (self.directory / "trials").mkdir(parents=True, exist_ok=True)
        begun = (MARKER, "trials", "sweep.part")
        if any(path.name not in begun for path in self.directory.iterdir()):
            raise ScenarioError(f"'{self.directory}' holds something else than a sweep; name a new directory")
        _write(file, json.dumps(described, indent=2) + "\n")

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of all finished trials, in order; raises ScenarioError for a damaged row."""
        rows: list[dict[str, Any]] = []
        for trial in self.trials:
            if (file := self._row(trial)).exists():
                row = _read(file)
                if not isinstance(row.get("error", 0), str | None):
                    raise ScenarioError(f"'{file}' is no row of a sweep: delete it, and its trial runs again")
                about = {"trial": trial.number, "repetition": trial.repetition, **trial.settings}
                rows.append(about | row | about)
        return rows

    def pending(self) -> list[Trial]:
        """Return the trials not done yet."""
        return [trial for trial in self.trials if not self._row(trial).exists()]

    def run(self, jobs: int, *, ray: str | None = None) -> Iterator[dict[str, Any]]:
        """Run the pending trials, `jobs` at a time, and yield each row once written.

        `ray` is the address of a Ray cluster with nodes for the trials; `jobs` is then left to Ray. Raises
        ConnectError if there is no cluster, and SessionError if the cluster fails.
        """
        pending = self.pending()
        # threads: a trial is a process already, and one that dies takes no worker with it
        made = run_calls(run_trial, self._calls(pending), jobs, ray=ray, workers="threading")
        for number, found in made:
            row = {"scenario_hash": self.scenario_hash} | found
            _write(self._row(pending[number]), json.dumps(row, indent=2) + "\n")
            yield row

    def _calls(self, trials: Sequence[Trial]) -> list[_Call]:
        file = Path(self.scenario)
        scenario = str(file.resolve()) if file.suffix else self.scenario
        return [
            (
                scenario,
                [
                    *self.overrides,
                    *(f"{path}={text}" for path, text in _setting_texts(trial.settings).items()),
                ],
                str(self.directory.resolve() / "trials" / trial.name) if self.recorded else None,
            )
            for trial in trials
        ]

    def _fixed_settings(self) -> dict[str, str]:
        return {path: value for path, _, value in (each.partition("=") for each in self.overrides)}

    def _describe_sweep(self) -> dict[str, Any]:
        """Return the settings of the sweep for `sweep.json`."""
        return {
            "scenario": self.scenario,
            "scenario_hash": self.scenario_hash,
            "vary": {variation.path: list(variation.values) for variation in self.variations},
            "repeat": self.repeat,
            "seed": self.seed,
            "set": list(self.overrides),
            "recorded": self.recorded,
        }

    def _row(self, trial: Trial) -> Path:
        return self.directory / "trials" / f"{trial.name}.json"


def _setting_texts(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return values as texts for `--set`."""
    return {path: json.dumps(value) for path, value in settings.items()}


def _read(file: Path) -> dict[str, Any]:
    """Return the JSON object in a file of a sweep. Raises ScenarioError if there is none."""
    try:
        found: Any = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ScenarioError(
            f"'{file}' cannot be read ({error}): delete it; what it held is made again"
        ) from error
    if not isinstance(found, dict):
        raise ScenarioError(f"'{file}' holds no JSON object: delete it; what it held is made again")
    return cast("dict[str, Any]", found)


def _write(file: Path, text: str) -> None:
    """Write a file in a single piece."""
    with whole_file(file) as part:
        part.write_text(text, encoding="utf-8")
