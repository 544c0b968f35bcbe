"""The part of a report about training tasks: score cards, events on a time line, paths of the tips."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

import numpy as np

from hub.recording.recording import Recording
from hub.recording.report_canvas import INK, SERIES, Figure, axes_of, draw_legend
from hub.recording.scores import score_numbers, score_tables
from schemas.trocar_msgs import ScoreCard, TaskEvent

__all__ = ["last_score_cards", "score_figures", "score_table"]

_MM = 1e3


def last_score_cards(recording: Recording) -> dict[str, ScoreCard]:
    """Return the last score card of each participant with a published card."""
    found: dict[str, ScoreCard] = {}
    for port, kind in recording.ports.items():
        if kind == ScoreCard.ros_type:
            for _, card in recording[port].messages():
                if isinstance(card, ScoreCard):
                    found[port.partition(".")[0]] = card
    return found


def score_table(name: str, card: ScoreCard) -> str:
    """Return the tables of a card as HTML, with bars beside comparable values."""
    numbers = score_numbers(card)
    bars = _comparison_bars(numbers["metrics"])
    tables: list[str] = []
    for heads, rows in score_tables(name, numbers):
        keys = [row[0].replace(" ", "_") for row in rows]
        barred = heads[0].startswith(name) and any(key in bars for key in keys)
        head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
        head += "<th></th>" if barred else ""
        lines: list[str] = []
        for key, row in zip(keys, rows, strict=True):
            cells = "".join(f"<td>{_text_to_html(cell)}</td>" for cell in row)
            cells += f"<td>{bars.get(key, '')}</td>" if barred else ""
            lines.append(f"<tr>{cells}</tr>")
        body = "\n".join(lines)
        region = f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(heads[0])}">'
        tables.append(f"{region}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>")
    return f'<div class="cards">{"".join(tables)}</div>'


def _comparison_bars(metrics: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return a bar for each metric with a value to compare.

    Times are relative to the longest, the time of the trial; values of an arm, to the larger of the arms.
    """
    groups: dict[str, dict[str, float]] = {}
    for name, one in metrics.items():
        if one["value"] is not None:
            group = "s" if one["unit"] == "s" else name.rpartition("/")[2]
            groups.setdefault(group, {})[name] = abs(one["value"])
    return {
        name: f'<span class="bar" style="width:{100.0 * value / max(group.values()):.1f}%"></span>'
        for group in groups.values()
        if len(group) > 1 and max(group.values()) > 0.0
        for name, value in group.items()
    }


def _text_to_html(text: str) -> str:
    """Return a text as HTML, with parts between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def score_figures(recording: Recording, name: str) -> Iterator[Figure]:
    """Yield the time line of the events of task `name`, and the path of each watched tip."""
    events = [
        (time_s, event)
        for port, kind in recording.ports.items()
        if kind == TaskEvent.ros_type and port.startswith(f"{name}.")
        for time_s, event in recording[port].messages()
        if isinstance(event, TaskEvent)
    ]
    if events:
        yield _time_line(name, events)
    for connection in recording.plan().connections:
        source = f"{connection.source}.{connection.source_port}"
        arm, _, port = connection.target_port.partition("/")
        if connection.target == name and port == "measured_cp" and arm != "ECM" and source in recording:
            yield _tip_path_figure(
                recording, source, arm, [(t, event) for t, event in events if event.arm == arm]
            )


def _time_line(name: str, events: list[tuple[float, TaskEvent]]) -> Figure:
    """All events, a row for each object or arm."""
    subjects = sorted({_event_subject(event) for _, event in events})
    kinds = sorted({event.event for _, event in events})
    with axes_of("time (s)", "") as (axes, result):
        for i, kind in enumerate(kinds):
            points = [
                (t, subjects.index(_event_subject(event))) for t, event in events if event.event == kind
            ]
            x, y = zip(*points, strict=True)
            marker = "osD^vPX*"[i % 8]
            axes.plot(x, y, linestyle="", marker=marker, color=SERIES[i % len(SERIES)], label=kind)
        axes.set_yticks(range(len(subjects)), subjects)
        axes.margins(y=0.2)
        draw_legend(axes)
    caption = "; ".join(f"{sum(e.event == kind for _, e in events)} {kind}" for kind in kinds) + "."
    return Figure(f"{name}: events", result.svg(caption), caption)


def _event_subject(event: TaskEvent) -> str:
    return event.object or event.arm or "instruments"


def _tip_path_figure(
    recording: Recording, source: str, arm: str, events: list[tuple[float, TaskEvent]]
) -> Figure:
    """Path of a tip in the frame of the arm's base, from above and from the front, with the events on it."""
    series = recording[source]
    position = (series["position"] - series["position"][:1]) * _MM
    with axes_of("x (mm)", "y, z (mm)") as (axes, result):
        for i, label in (1, "y: from above"), (2, "z: from the front"):
            axes.plot(position[:, 0], position[:, i], color=SERIES[i - 1], linewidth=0.9, label=label)
        at = np.searchsorted(series.time, [t for t, _ in events]).clip(max=len(position) - 1)
        for i in (1, 2):
            axes.plot(position[at, 0], position[at, i], linestyle="", marker=".", color=INK)
        axes.set_aspect("equal", adjustable="datalim")
        draw_legend(axes)
    way = float(np.linalg.norm(np.diff(position, axis=0), axis=1).sum()) / _MM
    caption = f"Path of the tip from where it started, in {series.frame}: {way:.3f} m. Dots: its events."
    return Figure(f"{arm}: path of the tip", result.svg(caption), caption)
