"""The results of a sweep: a table of all trials, and plots over the varied parameters."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from learning.own_directory import whole_file
from learning.sweeps.variation import Variation, number_and_unit

__all__ = ["flatten_row", "write_plots", "write_table"]

_ABOUT_THE_RUN = {
    "trial", "repetition", "scenario_hash", "attempts", "node", "recording", "state", "error", "ending",
    "steps", "sim_time_s", "wall_time_s", "real_time_factor", "late_steps", "dropped_messages", "state_hash",
    "recording_complete", "energy_residual_j",
}  # fmt: skip
"""Columns about the run itself, not plotted."""
_MOST_PLOTS = 12
_LARGEST = 1e300
"""Absolute value of a number drawn; a damaged row may hold any."""


def flatten_row(row: Mapping[str, Any], variations: Sequence[Variation]) -> dict[str, Any]:
    """Return a row without mappings in it, and varied values as numbers if their unit is common."""
    units = {variation.path: variation.unit for variation in variations}
    made: dict[str, Any] = {}
    for name, value in row.items():
        if units.get(name) is not None and (found := number_and_unit(value)) is not None:
            made[name] = found[0]
        elif isinstance(value, Mapping):
            made |= {f"{name}.{key}": each for key, each in flatten_row(value, ()).items()}  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]
        else:
            made[name] = json.dumps(value) if isinstance(value, list) else value
    return made


def write_table(rows: Sequence[Mapping[str, Any]], variations: Sequence[Variation], file: Path) -> None:
    """Write all rows as a parquet file; the unit of a varied parameter is in the column's metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    made = [flatten_row(row, variations) for row in rows]
    units = {variation.path: variation.unit for variation in variations}
    fields: list[Any] = []
    columns: list[Any] = []
    for name in dict.fromkeys(name for row in made for name in row):
        values = [row.get(name) for row in made]
        try:
            column = pa.array(values)
        except (pa.ArrowException, OverflowError):  # of several types, or a number beyond 64 bits
            column = pa.array([None if value is None else str(value) for value in values])
        metadata = {"unit": unit} if (unit := units.get(name)) else None
        fields.append(pa.field(name, column.type, metadata=metadata))
        columns.append(column)
    with whole_file(file) as part:
        pq.write_table(pa.Table.from_arrays(columns, schema=pa.schema(fields)), part)


def write_plots(rows: Sequence[Mapping[str, Any]], variations: Sequence[Variation], file: Path) -> bool:
    """Draw each measure over each varied parameter; return False if there is nothing to draw."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    made = [flatten_row(row, variations) for row in rows]
    varied = [each for each in variations if len(each.values) > 1]
    measures = [
        name
        for name in dict.fromkeys(name for row in made for name in row)
        if _is_measure(name, made, varied)
    ]
    measures = measures[:_MOST_PLOTS]
    if not measures or not varied:
        return False
    size = (4.5 * len(varied), 2.6 * len(measures))
    subplots: Any = plt.subplots
    figure, axes = subplots(len(measures), len(varied), figsize=size, squeeze=False, layout="constrained")
    for line, measure in zip(axes, measures, strict=True):
        for axis, variation in zip(line, varied, strict=True):
            _draw(axis, made, variation, measure)
    with whole_file(file) as part:
        figure.savefig(part, dpi=120, format="png")
    plt.close(figure)
    return True


def _is_measure(name: str, rows: Sequence[Mapping[str, Any]], varied: Sequence[Variation]) -> bool:
    if name in _ABOUT_THE_RUN or name in {variation.path for variation in varied}:
        return False
    return any(_is_number(row.get(name)) for row in rows)


def _is_number(value: Any) -> bool:
    """Return whether a value can be drawn."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _LARGEST


def _draw(axis: Any, rows: Sequence[Mapping[str, Any]], variation: Variation, measure: str) -> None:
    """Draw all trials as points, and the mean of trials with the same value as a line."""
    points = [(row[variation.path], row[measure]) for row in rows if _is_number(row.get(measure))]
    if variation.unit is None:
        points = [(str(x), y) for x, y in points]
    means = {x: [y for at, y in points if at == x] for x, _ in points}
    axis.plot(*zip(*points, strict=True), "o", alpha=0.4, markersize=4)
    axis.plot(list(means), [sum(ys) / len(ys) for ys in means.values()], "-")
    axis.set_xlabel(variation.path.rpartition(".")[2] + (f" [{variation.unit}]" if variation.unit else ""))
    axis.set_ylabel(measure)
