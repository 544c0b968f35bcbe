"""Output: results on stdout, as tables for people or as JSON for programs; progress on stderr."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any, Self

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from hub.observation.summary import Progress
from hub.planning.limits import safe_text
from schemas.readable import counted, label, readable
from schemas.scenario import Scenario

__all__ = [
    "LATENCY_COLUMNS",
    "RunProgress",
    "console",
    "latency_rows",
    "results",
    "show",
    "show_tables",
    "table",
]

_LONGEST = 10_000
"""Most characters of a cell."""

_UNITS = {"s": "s", "n": "N", "j": "J", "m": "m"}

console = Console(stderr=True, highlight=False)
"""Progress, warnings and errors."""
results = Console(highlight=False)
"""Results: what a redirection to a file keeps."""


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
    """Print a flat result on stdout, as JSON or as a table."""
    if as_json:
        typer.echo(json.dumps(result, indent=2, default=str))
        return
    results.print(table(_readable_value(name, value) for name, value in result.items() if value is not None))


def show_tables(tables: Iterable[tuple[Iterable[str], Iterable[Iterable[object]]]]) -> None:
    """Print tables, each given as heads of columns and rows, on stdout; an empty line before each."""
    for columns, rows in tables:
        results.print()
        results.print(table(rows, *columns))


def show_commands(commands: Iterable[tuple[str, str]]) -> None:
    """Print commands to go on with, each with its purpose, on stdout; a long line is not folded."""
    rows = list(commands)
    widest = max(len(command) for command, _ in rows)
    for command, purpose in rows:
        results.print(Text(f"{safe_text(command, _LONGEST):{widest}}  # {purpose}"), soft_wrap=True)


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

    def __init__(self, scenario: Scenario, name: str | None = None) -> None:
        """`name`: the scenario as the user calls it; None: as it calls itself."""
        self._bar = Bar(
            TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[now]}"), console=console
        )
        total = None if scenario.duration is None else scenario.duration / 1e9
        self._task = self._bar.add_task(escape(safe_text(name or scenario.name)), total=total, now="starting")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def __call__(self, progress: Progress) -> None:
        """Show the progress of the run."""
        live = (
            f"{label(name, unit)} {readable(value, unit)}" for name, (value, unit) in progress.live.items()
        )
        late = (counted(progress.late_steps, "late step"),) if progress.late_steps else ()
        now = "  ".join(
            (f"{progress.sim_time_s:.2f} s", f"{progress.real_time_factor:.2f} x real time", *late, *live)
        )
        self._bar.update(self._task, completed=progress.sim_time_s, now=now)
