"""Output: tables and progress on stderr for people, JSON on stdout for programs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any, Self

import typer
from rich.console import Console
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from hub.observation.summary import Progress
from hub.planning.limits import safe_text
from hub.recording.profiles import profile_tables
from hub.recording.scores import score_tables
from schemas.scenario import Scenario

__all__ = ["LATENCY_COLUMNS", "RunProgress", "console", "latency_rows", "show", "table"]

_LONGEST = 10_000
"""Most characters of a cell."""

_UNITS = {"s": "s", "n": "N", "j": "J", "m": "m"}

console = Console(stderr=True, highlight=False)


def table(rows: Iterable[Iterable[object]], *columns: str) -> Table:
    """Return a plain table of `rows` under `columns`."""
    made = Table(box=None, pad_edge=False, show_header=bool(columns))
    for name in columns:
        made.add_column(name, overflow="fold")  # a narrow terminal cuts nothing off
    for row in rows:
        # a name may be a stranger's: it is neither markup of rich nor a command to the terminal
        made.add_row(*(Text(safe_text(str(cell), _LONGEST)) for cell in row))
    return made


def show(result: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a result, as JSON on stdout or as a table on stderr."""
    if as_json:
        typer.echo(json.dumps(result, indent=2, default=str))
        return
    console.print(
        table(
            _readable_value(name, value)
            for name, value in result.items()
            if value is not None and not isinstance(value, dict)
        )
    )
    if observers := result.get("observers"):
        console.print()
        console.print(table(_observer_rows(observers), *_OBSERVER_COLUMNS))
    if rows := list(latency_rows(result.get("latency", {}))):
        console.print()
        console.print(table(rows, *LATENCY_COLUMNS))
    for name, scores in result.get("scores", {}).items():
        for columns, cells in score_tables(name, scores):
            console.print()
            console.print(table(cells, *columns))
    profile = result.get("profile")
    for columns, cells in profile_tables(profile) if profile else ():
        console.print()
        console.print(table(cells, *columns))


_OBSERVER_COLUMNS = ("observer", "states", "dropped", "per second", "attainable", "lost")


def _observer_rows(observers: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[object, ...]]:
    """Yield a row for each observer with a time of its own."""
    for name, row in observers.items():
        seen, dropped = row["states"], row["dropped"]
        share = f"{dropped} ({dropped / max(seen + dropped, 1):.1%})"
        yield name, seen, share, f"{row['rate']:.1f}", f"{row['attainable_rate']:.1f}", row["lost"] or ""


LATENCY_COLUMNS = ("latency", "stream", "count", "p50", "p99", "largest")
_TIMES = ("p50_s", "p99_s", "largest_s")
_MOST_STREAMS = 8
"""Most streams of a device shown singly: a gateway to ROS has dozens. `--json` has all streams."""


def latency_rows(latency: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Iterator[tuple[object, ...]]:
    """Yield the rows of a summary's latency; none if no device takes part."""
    if latency.keys() <= {"grant to state"}:
        return
    for way, streams in latency.items():
        of_device: dict[str, dict[str, Mapping[str, float]]] = {}
        for stream, row in streams.items():
            of_device.setdefault(stream.rpartition(" -> ")[2].partition(".")[0], {})[stream] = row
        for device, rows in of_device.items():
            shown = rows
            if len(rows) > _MOST_STREAMS:
                slowest = max(rows.values(), key=lambda row: row["p99_s"])
                shown = {f"{device}, the slowest of {len(rows)}": slowest}
            for stream, row in shown.items():
                yield way, stream, round(row["count"]), *(f"{1e3 * row[name]:.3f} ms" for name in _TIMES)


def _readable_value(name: str, value: Any) -> tuple[str, str]:
    """Return label and value; a unit at the end of the name follows the value."""
    stem, _, suffix = name.rpartition("_")
    unit = _UNITS.get(suffix)
    label = (stem if unit else name).replace("_", " ")
    return label, f"{f'{value:.6g}' if isinstance(value, float) else value} {unit or ''}".rstrip()


class RunProgress:
    """The progress line of a run: simulated time, real-time factor, late steps, live measures."""

    def __init__(self, scenario: Scenario) -> None:
        self._bar = Bar(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[now]}"), console=console
        )
        total = None if scenario.duration is None else scenario.duration / 1e9
        self._task = self._bar.add_task(scenario.name, total=total, now="starting")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, progress: Progress) -> None:
        """Show the progress of the run."""
        live = (f"{name} {value:.3f} {unit}".rstrip() for name, (value, unit) in progress.live.items())
        late = (f"{progress.late_steps} late steps",) if progress.late_steps else ()
        now = "  ".join(
            (f"{progress.sim_time_s:.2f} s", f"{progress.real_time_factor:.2f} x real time", *late, *live)
        )
        self._bar.update(self._task, completed=progress.sim_time_s, now=now)
