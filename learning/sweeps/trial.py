"""A trial of a sweep: `trocar run` in its own process; every end of the process is a row."""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from learning.sweeps.variation import Variation

__all__ = ["Trial", "plan_trials", "run_trial"]

_ATTEMPTS = 2
_LAST_LINES = 3
_LEFT_OUT = {"latency", "observers", "profile", "session", "recording"}
"""Entries of a summary left out of a row, or present there under another name."""


@dataclass(frozen=True)
class Trial:
    """The values of a trial, and the number of the repetition, from 0."""

    number: int
    repetition: int
    settings: Mapping[str, Any]
    """Values of the scenario by their path."""

    @property
    def name(self) -> str:
        """The name of the trial's files."""
        return f"{self.number:05d}"


def plan_trials(variations: Sequence[Variation], repeat: int, seed: str | None) -> list[Trial]:
    """Return all trials: each combination of values, `repeat` times, the last variation changing fastest.

    `seed` is the path of a parameter set to the number of the repetition, from 0.
    """
    combinations = product(*(variation.values for variation in variations))
    settings = [
        {variation.path: value for variation, value in zip(variations, values, strict=True)}
        | ({seed: repetition} if seed else {})
        for values in combinations
        for repetition in range(repeat)
    ]
    return [Trial(number, number % repeat, each) for number, each in enumerate(settings)]


def run_trial(scenario: str, overrides: Sequence[str], recording: str | None) -> dict[str, Any]:
    """Run a trial, again if the process ends with a failure, and return the row.

    Args:
        scenario: name or path for `trocar run`.
        overrides: values for `--set`.
        recording: the directory of the recording; present contents are removed first.
    """
    command = [sys.executable, "-P", "-m", "hub.command_line.child", str(os.getpid())]
    command += ["run", scenario, "--pace", "fast", "--json"]
    command += [part for override in overrides for part in ("--set", override)]
    command += ["--record", recording] if recording else []
    row: dict[str, Any] = {}
    for attempt in range(1, _ATTEMPTS + 1):
        if recording:
            shutil.rmtree(recording, ignore_errors=True)
        done = _run_child(command)
        row = {"attempts": attempt, "node": platform.node(), "recording": recording} | _ending(done)
        if row["error"] is None:
            break
    return row


def _run_child(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command that ends with this process: by the kernel, or else by the end of its input."""
    reading, writing = os.pipe()
    try:
        return subprocess.run(command, stdin=reading, capture_output=True, text=True, check=False)
    finally:
        os.close(reading)
        os.close(writing)


def _ending(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """Return the result of a process: the summary, or why there is none."""
    if done.returncode == 0:
        summary: dict[str, Any] = json.loads(done.stdout)
        kept = {name: value for name, value in summary.items() if name not in _LEFT_OUT}
        return {"error": None} | kept
    if done.returncode < 0:
        return {"state": "died", "error": f"killed by signal {-done.returncode}"}
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    return {"state": "failed", "error": "\n".join(lines[-_LAST_LINES:]) or f"exit code {done.returncode}"}
