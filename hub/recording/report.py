"""A self-contained HTML page about a recorded session."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from hub.recording.bond_trace import BondTrace, read_bond_trace
from hub.recording.profiles import profile_numbers, profile_tables
from hub.recording.recording import Recording
from hub.recording.report_canvas import Figure
from hub.recording.report_figures import (
    energy_figures,
    force_figure,
    motion_figure,
    pace_figure,
    press_figure,
    step_time_figures,
)
from hub.recording.report_notes import participant_notes
from hub.recording.report_scores import last_score_cards, score_figures, score_table
from hub.recording.report_tissue import tissue_figures
from hub.recording.report_vision import vision_figures
from schemas.errors import RecordingError
from schemas.scenario import Bond, Scenario
from schemas.trocar_msgs import SessionStatus
from schemas.vectors import Vector

__all__ = ["report"]


def report(recording: Recording, output: Path) -> None:
    """Write the page about `recording` to the file `output`; the page loads nothing from anywhere.

    Raises MissingExtraError without matplotlib, RecordingError if the recording is not of a session or
    `output` cannot be written.
    """
    scenario = recording.scenario()
    traces = [trace for bond in scenario.bonds if (trace := read_bond_trace(recording, bond)) is not None]
    books = {bond.name: _energy_book(recording, bond) for bond in scenario.bonds}
    statuses = list(recording.statuses())
    page = Template((files("hub.recording") / "report_page.html").read_text(encoding="utf-8"))
    text = page.substitute(
        title=escape(scenario.name),
        description=escape(scenario.description),
        numbers=_numbers(recording, scenario, statuses[-1][1] if statuses else None, traces, books),
        bonds=_html_section("Coupling", _bond_figures(traces, books)),
        steps=_html_section("Timing", _step_figures(recording, scenario, statuses)),
        scores=_score_sections(recording),
        vision=_html_section("Vision", vision_figures(recording)),
        tissue=_html_section("Tissue", tissue_figures(recording)),
        profile=_profile(recording),
        notes=_notes_section(scenario),
        ports=_table(("topic", "type", "messages", "per second"), _ports(recording)),
        scenario=escape(recording.attachments.get("scenario.yaml", b"").decode("utf-8", "replace")),
        versions=_table(("package", "version"), sorted(recording.versions().items())),
        file=escape(recording.file.name),
    )
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write the report to '{output}': {error.strerror}") from error


def _energy_book(recording: Recording, bond: Bond) -> tuple[Vector, Vector, Vector]:
    """Return times (s), work given and work taken (J) of the energy book, each of shape (n,)."""
    rows = [
        (time_ns * 1e-9, entry.motion_work_j, entry.force_work_j)
        for time_ns, entry in recording.energy(bond.name)
    ]
    table = np.array(rows, np.float64).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _bond_figures(
    traces: Iterable[BondTrace], books: dict[str, tuple[Vector, Vector, Vector]]
) -> Iterator[Figure]:
    for trace in traces:
        yield from (press_figure(trace), force_figure(trace), motion_figure(trace))
    for bond, (times_s, given, taken) in books.items():
        if len(times_s):
            yield from energy_figures(bond, times_s, given, taken)


def _step_figures(
    recording: Recording, scenario: Scenario, statuses: list[tuple[int, SessionStatus]]
) -> Iterator[Figure]:
    compute: dict[str, tuple[Vector, Vector]] = {}
    for name, spec in scenario.participants.items():
        period_ns = spec.period or scenario.step
        rows = [
            (ack.step * scenario.step + i * period_ns, spent)
            for ack in recording.acks(name)
            for i, spent in enumerate(ack.compute_ns.tolist())
        ]
        if rows:
            times_ns, spent_ns = np.array(rows, np.float64).T
            compute[name] = (times_ns * 1e-9, spent_ns * 1e-9)
    if compute:
        yield from step_time_figures(compute, scenario.step * 1e-9)
    pace = np.array(
        [(time_ns * 1e-9, status.real_time_factor) for time_ns, status in statuses if status.step > 0],
        np.float64,
    ).reshape(-1, 2)
    if len(pace) > 1:
        yield pace_figure(pace[:, 0], pace[:, 1])


def _numbers(
    recording: Recording,
    scenario: Scenario,
    status: SessionStatus | None,
    traces: list[BondTrace],
    books: dict[str, tuple[Vector, Vector, Vector]],
) -> str:
    """Return the summary as a definition list."""
    rows: list[tuple[str, str]] = []
    if status is not None:
        rows += [
            ("ended", status.state),
            ("steps", f"{status.step:,}"),
            ("simulated time", f"{status.sim_time_ns * 1e-9:.3f} s"),
            ("real-time factor", f"{status.real_time_factor:.2f}"),
            ("late steps", f"{status.late_steps:,}"),
            ("dropped messages", f"{status.dropped_messages:,}"),
        ]
    rows.append(("communication step", f"{scenario.step * 1e-6:g} ms"))
    rows += [(f"peak force, {trace.name}", f"{trace.peak:.3f} N") for trace in traces]
    rows += [
        (f"energy residual, {bond}", f"{(taken[-1] - given[-1]) * 1e6:.3g} µJ")
        for bond, (_, given, taken) in books.items()
        if len(given)
    ]
    rows += [
        ("messages", f"{sum(recording.counts.values()):,}"),
        ("recording", f"{recording.file.stat().st_size / 1e6:.1f} MB"),
    ]
    lines = [f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in rows]
    if status is not None and status.detail:
        lines[0] = lines[0].replace("</dd>", f"<p>{escape(status.detail)}</p></dd>")
    return "\n".join(lines)


def _profile(recording: Recording) -> str:
    """Return the section about where the time went; empty if no profile was recorded."""
    profile = recording.profile()
    if profile is None:
        return ""
    tables = "\n".join(_table(heads, rows) for heads, rows in profile_tables(profile_numbers(profile)))
    return f'<section aria-labelledby="h-profile"><h2 id="h-profile">Processor time</h2>{tables}</section>'


def _notes_section(scenario: Scenario) -> str:
    """Return the section about the validity of the results; empty if no participant has notes."""
    rows = list(participant_notes(scenario))
    if not rows:
        return ""
    heading = '<h2 id="h-notes">Validity</h2>'
    table = _table(("participant", "of", "is"), rows)
    return f'<section id="notes" aria-labelledby="h-notes">{heading}{table}</section>'


def _score_sections(recording: Recording) -> str:
    """Return the sections about training tasks; empty if there was none."""
    return "\n".join(
        f'<section class="score" aria-labelledby="h-{escape(name)}"><h2 id="h-{escape(name)}">Score:'
        f" {escape(name)}</h2>{score_table(name, card)}"
        f'<div class="figures">{_html_sections(score_figures(recording, name))}</div></section>'
        for name, card in last_score_cards(recording).items()
    )


def _ports(recording: Recording) -> Iterator[tuple[str, str, str, str]]:
    seconds = recording.duration_ns * 1e-9
    for name, count in sorted(recording.counts.items()):
        yield name, recording.topics[name], f"{count:,}", f"{count / seconds:.1f}" if seconds else ""


def _html_section(title: str, figures: Iterable[Figure]) -> str:
    """Return a section with figures; empty if there are none."""
    found, key = _html_sections(figures), f"h-{title.lower()}"
    if not found:
        return ""
    heading = f'<h2 id="{key}">{title}</h2>'
    return f'<section aria-labelledby="{key}">{heading}<div class="figures">{found}</div></section>'


def _html_sections(figures: Iterable[Figure]) -> str:
    return "\n".join(
        f"<figure><h3>{escape(f.title)}</h3>{f.svg}<figcaption>{escape(f.caption)}</figcaption></figure>"
        for f in figures
    )


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    region = f'<div class="scroll" tabindex="0" role="region" aria-label="by {escape(heads[0])}">'
    return f"{region}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
