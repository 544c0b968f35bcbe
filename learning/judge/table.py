"""The table of a verdict: a row for each trial, as parquet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from learning.judge.episode import Row
from learning.own_directory import whole_file

__all__ = ["write_table"]


def write_table(rows: Sequence[Row], file: Path) -> None:
    """Write all rows; nested numbers become columns such as `first.grasped` and `metrics.drops`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    flat = [_flatten(row) for row in rows]
    names = dict.fromkeys(name for row in flat for name in row)
    table = pa.table({name: pa.array([row.get(name) for row in flat]) for name in names})
    with whole_file(file) as part:
        pq.write_table(table, part)


def _flatten(row: Mapping[str, Any]) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            made |= {f"{name}.{key}": each for key, each in value.items()}  # pyright: ignore[reportUnknownVariableType]
        else:
            made[name] = value
    return made
