"""The page of a verdict: rates with intervals, failures, and each trial with the commands to appeal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from shlex import quote
from string import Template
from typing import Any

from learning.judge.difficulties import DIFFICULTIES
from learning.judge.episode import Row, Trial
from learning.judge.failures import FAILURES
from learning.judge.intervals import Rate, success_rate
from learning.judge.operations import OPERATION_FAILURES, OPERATIONS
from learning.judge.summary import Result, results_of
from learning.own_directory import whole_file

__all__ = ["write_page"]


def write_page(described: Mapping[str, Any], rows: Sequence[Row], file: Path) -> None:
    """Write the page about the rows; `described` is the verdict's own description."""
    results = results_of(rows)
    total = success_rate(sum(row["success"] for row in rows), len(rows))
    template = Template((files("learning.judge") / "page.html").read_text(encoding="utf-8"))
    text = template.substitute(
        policy=escape(str(described["policy"])),
        total=escape(_percent(total)),
        count=len(rows),
        version=escape(str(described["trocar"])),
        results="".join(_result_row(result) for result in results),
        difficulties=_definitions(
            (name, DIFFICULTIES[name].description) for name in described["difficulties"]
        ),
        failures=_failures(results),
        classes=_definitions(_classes(row["exercise"] for row in rows)),
        trials="".join(_trial_row(row, recorded=bool(described["recorded"])) for row in rows),
    )
    with whole_file(file) as part:
        part.write_text(text, encoding="utf-8")


def _percent(rate: Rate) -> str:
    return f"{100.0 * rate.value:.0f} % ({100.0 * rate.low:.0f} to {100.0 * rate.high:.0f} %)"


def _result_row(result: Result) -> str:
    rate = result.rate
    bar = (
        f'<svg viewBox="0 0 100 10" role="img" aria-label="{escape(_percent(rate))}">'
        f'<rect class="back" width="100" height="10"/><rect class="share" width="{100.0 * rate.value:.1f}"'
        f' height="10"/><path d="M{100.0 * rate.low:.1f} 5H{100.0 * rate.high:.1f}M{100.0 * rate.low:.1f} 2v6'
        f'M{100.0 * rate.high:.1f} 2v6"/></svg>'
    )
    cells = (
        escape(result.exercise),
        escape(result.difficulty),
        f"{rate.successes} of {rate.trials}",
        bar + escape(_percent(rate)),
        _number(result.time_s, "{:.1f}"),
        _number(result.path_m, "{:.2f}"),
        _number(result.peak_force_n, "{:.1f}"),
        str(result.drops),
        escape(", ".join(f"{kind} {count}" for kind, count in result.phases.items()) or "–"),
    )
    return _row(cells)


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else form.format(value)


def _row(cells: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>\n"


def _definitions(pairs: Iterable[tuple[str, str]]) -> str:
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>\n" for name, text in pairs)


def _failures(results: Sequence[Result]) -> str:
    return "".join(
        _row((escape(result.exercise), escape(result.difficulty), escape(kind), str(count)))
        for result in results
        for kind, count in result.failures.items()
    )


def _classes(exercises: Iterable[str]) -> Iterable[tuple[str, str]]:
    """Return the classes of failure of some exercises, with descriptions."""
    kinds = [OPERATION_FAILURES if name in OPERATIONS else FAILURES for name in exercises]
    return {kind: text for one in kinds for kind, text in one.items()}.items()


def _trial_row(row: Row, *, recorded: bool) -> str:
    name = Trial(row["exercise"], row["difficulty"], row["seed"]).name
    outcome = "success" if row["success"] else row["failure"]
    place = f"trials/{name}"
    look = f"trocar view {quote(place)} --at {row['decisive_s']:.2f}"
    cells = (
        escape(row["exercise"]),
        escape(row["difficulty"]),
        str(row["seed"]),
        f'<span class="{"good" if row["success"] else "bad"}">{escape(outcome)}</span>'
        + (f"<br><small>{escape(row['error'])}</small>" if row["error"] else ""),
        f"{row['time_s']:.1f}",
        f'<a href="{escape(place)}/">{escape(name)}</a><br><code>{escape(look)}</code>' if recorded else "–",
        f"<code>{escape(row['state_hash'])}</code>",
    )
    return _row(cells)
