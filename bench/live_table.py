"""The table of `bench.live` in markdown, and in docs/live.md."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["redraw", "redrawn", "table"]

DOCS = Path(__file__).parent.parent / "docs" / "live.md"
BEGIN, END = "<!-- bench/live.py -->", "<!-- end -->"
HEAD = (
    "| scenario | s | real time | attainable | bare | wall, of bare | processor, of bare"
    " | core-seconds per s | bare |",
    "|---|---|---|---|---|---|---|---|---|",
)


def table(result: Mapping[str, Any]) -> str:
    """Return the table of a result, in markdown."""
    facts = (
        f"- {result['cores']} cores",
        f"- {_circumstances(result)}",
        *(f"- left out: `{name}`: {why}" for name, why in result["left_out"].items()),
    )
    return "\n".join([*HEAD, *_rows(result).values(), "", *facts])


def _circumstances(result: Mapping[str, Any]) -> str:
    begin, end = (" ".join(f"{load:.1f}" for load in result[name]) for name in ("load_begin", "load_end"))
    return f"medians of {result['runs']} runs, load {begin} at the begin, {end} at the end"


def _rows(result: Mapping[str, Any]) -> dict[str, str]:
    """Return the lines of the rows by name."""
    lines: dict[str, str] = {}
    for row in result["rows"]:
        attainable = row["attainable_real_time_factor"]
        cells = (
            row["name"],
            f"{row['seconds']:g}",
            f"{row['real_time_factor']:.2f}",
            "" if attainable is None else f"{attainable:.2f}",
            *(f"{row[name]:.2f}" for name in ("bare_real_time_factor", "wall_ratio", "core_ratio")),
            *(f"{row[name]:.3f}" for name in ("core_s_per_sim_s", "bare_core_s_per_sim_s")),
        )
        lines[row["name"]] = f"| {' | '.join(cells)} |"
    return lines


def redraw(result: Mapping[str, Any]) -> None:
    """Put the table into the page, or its rows where only some scenarios were measured."""
    DOCS.write_text(redrawn(DOCS.read_text(encoding="utf-8"), result), encoding="utf-8")


def redrawn(text: str, result: Mapping[str, Any]) -> str:
    """Return the page with the table of a result between its marks. Raises ValueError without marks.

    Other rows of the page stay where only some scenarios were measured; a line says how these were.
    """
    head, _, rest = text.partition(BEGIN)
    there, mark, tail = rest.partition(END)
    if not mark:
        raise ValueError(f"'{DOCS}' has no '{BEGIN}' with '{END}' after it, where the table goes")
    content = table(result) if result["whole"] else _merged(there, result)
    return f"{head}{BEGIN}\n{content}\n\n{END}{tail}"


def _merged(there: str, result: Mapping[str, Any]) -> str:
    lines = there.strip().splitlines()
    rows = {line.split("|")[1].strip(): line for line in lines if line.startswith("| ") and line != HEAD[0]}
    rows |= _rows(result)
    # the variants of one scenario stand last
    ordered = sorted(rows, key=lambda name: ("," in name, name))
    begins = [f"- {name}: " for name in _rows(result)]
    facts = [line for line in lines if line.startswith("- ") and not line.startswith(tuple(begins))]
    facts += [f"{begin}{_circumstances(result)}" for begin in begins]
    return "\n".join([*HEAD, *(rows[name] for name in ordered), "", *facts])
