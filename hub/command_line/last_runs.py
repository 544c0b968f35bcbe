"""Wall times of the last runs of installed scenarios by this user, for `trocar list`."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import typer
from pydantic import TypeAdapter, ValidationError

from hub.observation.summary import Summary

__all__ = ["last_wall_times", "remember_run"]

_log = logging.getLogger(__name__)
_TIMES = TypeAdapter(dict[str, float])


def remember_run(name: str, summary: Summary) -> None:
    """Keep the wall time of a run that has reached its end; a directory that cannot be written keeps none."""
    if summary.state != "done" or summary.ending:
        return
    times = last_wall_times() | {name: round(summary.wall_time_s, 2)}
    try:
        _file().parent.mkdir(parents=True, exist_ok=True)
        _file().write_text(json.dumps(times, indent=1, sort_keys=True), encoding="utf-8")
    except OSError as error:
        _log.debug("the wall time of '%s' is not kept: %s", name, error)


def last_wall_times() -> dict[str, float]:
    """Return the wall time of the last whole run of each scenario, s; empty if the file is not readable."""
    try:
        return _TIMES.validate_json(_file().read_bytes())
    except (OSError, ValidationError):
        return {}


def _file() -> Path:
    return Path(typer.get_app_dir("trocar")) / "last_runs.json"
