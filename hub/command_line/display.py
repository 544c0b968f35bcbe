"""What people see on stderr, and programs on stdout."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

import typer
from rich.console import Console
from rich.table import Table

__all__ = ["console", "show", "table"]

console = Console(stderr=True, highlight=False)


def table(rows: Iterable[Iterable[object]], *columns: str) -> Table:
    """Return a plain table of `rows` under `columns`."""
    made = Table(*columns, box=None, pad_edge=False, show_header=bool(columns))
    for row in rows:
        made.add_row(*(str(cell) for cell in row))
    return made


def show(result: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a result: to programs as JSON on stdout, to people as a table on stderr."""
    if as_json:
        typer.echo(json.dumps(result, indent=2, default=str))
        return
    rows = [(name.replace("_", " "), _readable(value)) for name, value in result.items() if value is not None and not isinstance(value, dict)]
    console.print(table(rows))


def _readable(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
