"""A trial of an operation: a session in processes of its own, and its score card as a row of the verdict."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

import trocar
from learning.judge.episode import Row, Trial
from learning.judge.operations import OPERATIONS
from learning.judge.policies import PolicyAddress
from learning.sweeps.trial import run_trial
from schemas.errors import RecordingError, ScenarioError
from schemas.ros import StringMessage
from schemas.trocar_msgs import TaskEvent

__all__ = ["judge_operation", "row_of"]

_FAULT = 3
"""Condition of a governor whose policy gives no valid answer."""


def judge_operation(address: PolicyAddress, trial: Trial, recording: Path | None) -> Row:
    """Return the row of a trial; a session or policy that fails is a failure with its error.

    Args:
        address: the policy.
        trial: operation, difficulty and patient.
        recording: a directory for the recording, or None.
    """
    with TemporaryDirectory() as scratch:
        place = recording or Path(scratch) / "recording"
        try:
            order = OPERATIONS[trial.exercise].order(address, trial.difficulty, trial.seed)
        except ScenarioError as error:
            return row_of(trial, {"error": str(error)}, [], "")
        ended = run_trial(order.scenario, order.overrides, str(place))
        try:
            told = trocar.Recording(place)
            events = [cast("TaskEvent", event) for _, event in told["task.events"].messages()]
            warnings = told["governor.warning"].messages() if "governor.warning" in told.ports else ()
            warning = "".join(cast("StringMessage", said).data for _, said in [*warnings][-1:])
        except RecordingError as error:
            return row_of(trial, {"error": ended["error"] or str(error)}, [], "")
        return row_of(trial, ended, events, warning)


def row_of(trial: Trial, ended: Mapping[str, Any], events: list[TaskEvent], warning: str) -> Row:
    """Return the row of a session that ended with these results; `warning`: last words of the governor."""
    metrics = _metrics(ended)
    first: dict[str, float] = {}
    last: dict[str, float] = {}
    for event in events:
        time = event.header.stamp.ns / 1e9
        first.setdefault(event.event, time)
        last[event.event] = time
    error, end = ended["error"], float(ended.get("sim_time_s", 0.0))
    success = error is None and metrics.get("success") == 1.0
    kind, decisive = None, end
    if error is not None:
        kind = "session failed"
    elif not success:
        kind = next(iter(_holding(metrics, "failed/")), "not finished")
        harms = [last[name] for name in _holding(metrics, "errors/") if name in last]
        if kind != "not finished":
            decisive = max(harms, default=end)
        elif ended.get("condition") == _FAULT:
            kind, error = "policy failed", warning
    return {
        **trial._asdict(),
        "success": success,
        "failure": kind,
        "decisive_s": decisive,
        "error": error,
        "steps": ended.get("steps", 0),
        "time_s": end,
        "distance": 1.0 - float(ended.get("progress", 0.0)),
        "first": first,
        "counts": dict(Counter(event.event for event in events)),
        "metrics": metrics,
        "state_hash": ended.get("state_hash", ""),
    }


def _metrics(ended: Mapping[str, Any]) -> dict[str, float]:
    """Return the valid metrics of the session's score cards, by name and unit."""
    return {
        f"{name} ({value['unit']})" if value["unit"] else name: value["value"]
        for card in ended.get("scores", {}).values()
        for name, value in card["metrics"].items()
        if value["value"] is not None
    }


def _holding(metrics: Mapping[str, float], prefix: str) -> list[str]:
    """Return the words after a prefix of metrics that are not 0."""
    return [
        name.removeprefix(prefix).replace("_", " ")
        for name, value in metrics.items()
        if name.startswith(prefix) and value
    ]
