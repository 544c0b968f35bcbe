"""The summary of a run for people: a sentence, numbers with units, what to do next."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import typer
from rich.markup import escape

from hub.command_line.display import LATENCY_COLUMNS, latency_rows, results, show_commands, show_tables, table
from hub.observation.summary import Summary
from hub.planning.foreign_code import foreign_code
from hub.planning.limits import safe_text
from hub.recording.profiles import profile_tables
from hub.recording.recording import Recording
from hub.recording.scores import score_tables
from schemas.readable import counted, label, readable

__all__ = ["show_summary"]

_OBSERVER_COLUMNS = ("observer", "states", "dropped", "per second", "attainable", "lost")


def show_summary(name: str, summary: Summary, *, again: str = "", everything: bool, as_json: bool) -> None:
    """Print a summary on stdout.

    Args:
        name: the scenario as the user calls it.
        summary: the summary.
        again: the command that runs the session again with more options.
        everything: also print numbers that only matter to some: latencies of a run in time, missing scores.
        as_json: print JSON instead, with everything.
    """
    if as_json:
        typer.echo(json.dumps(summary.as_dict(), indent=2, default=str))
        return
    results.print(_sentence(name, summary), soft_wrap=True)
    results.print(_speed(summary), soft_wrap=True)
    for participant, text in summary.warnings.items():
        warning = escape(safe_text(f"participant '{participant}' {text}", 1000))
        results.print(f"[yellow]{warning}[/]", soft_wrap=True)
    results.print()
    results.print(table(_numbers(summary, everything=everything)))
    if everything or summary.late_steps or any(one.lost for one in summary.observers.values()):
        if summary.observers:
            show_tables([(_OBSERVER_COLUMNS, _observer_rows(summary))])
        if rows := list(latency_rows(summary.latency)):
            show_tables([(LATENCY_COLUMNS, rows)])
    for task, card in summary.scores.items():
        show_tables(score_tables(task, card, everything=everything))
    show_tables(profile_tables(summary.profile) if summary.profile else ())
    if commands := list(_next_commands(again, summary)):
        results.print()
        show_commands(commands)


def _sentence(name: str, summary: Summary) -> str:
    """Return what was done and whether it succeeded, with markup."""
    title = f"[bold]{escape(safe_text(name))}[/]"
    ending = escape(safe_text(summary.ending or "", 1000))
    if summary.state != "done":
        return f"{title} [yellow]{escape(summary.state)}[/]{f': {ending}' if ending else ''}"
    verdict = {True: "[green]succeeded[/]", False: "[yellow]did not succeed[/]", None: "[green]done[/]"}
    text = "; ".join(filter(None, (escape(safe_text(summary.outcome, 1000)), ending)))
    return f"{title} {verdict[summary.succeeded]}{f': {text}' if text else ''}"


def _speed(summary: Summary) -> str:
    factor = summary.real_time_factor
    late = f"; {counted(summary.late_steps, 'late step')}" if summary.late_steps else ""
    return (
        f"{summary.sim_time_s:g} s simulated in {summary.wall_time_s:.3g} s, {factor:.3g} x real time{late}"
    )


def _numbers(summary: Summary, *, everything: bool) -> Iterator[tuple[str, str]]:
    """Yield the measures and the hash, and if `everything`, the rest."""
    for name, value in summary.measures.items():
        unit = summary.units.get(name, "")
        known = f"no value: {summary.missing[name]}" if value is None else readable(value, unit)
        yield label(name, unit), known
    if everything:
        yield "steps", f"{summary.steps}"
        yield "late steps", f"{summary.late_steps}"
        yield "energy residual of the bonds", readable(summary.energy_residual_j, "J")
    if everything or summary.dropped_messages:
        yield "dropped messages", f"{summary.dropped_messages}"
    yield "state hash", summary.state_hash


def _observer_rows(summary: Summary) -> Iterator[tuple[object, ...]]:
    """Yield a row for each observer with a time of its own."""
    for name, one in summary.observers.items():
        share = f"{one.dropped} ({one.dropped / max(one.states + one.dropped, 1):.1%})"
        yield name, one.states, share, f"{one.rate:.1f}", f"{one.attainable_rate:.1f}", one.lost or ""


def _next_commands(again: str, summary: Summary) -> Iterator[tuple[str, str]]:
    """Yield commands that go on from here, each with what it does."""
    if summary.recording is None:
        if again:
            yield f"{again} --record", "keep a recording, for pages, reports, pictures and forks"
            yield f"{again} --open", "watch it in the browser"
        return
    path = Path(summary.recording)
    place = path if path.is_dir() else path.parent
    yield f"trocar view {place}", "look at it in the browser, with a timeline"
    yield f"trocar report {place}", "a page with curves, in one file"
    yield f"trocar film {place}", "a film"
    if summary.scores:
        yield f"trocar score {place}", "all metrics and events"
    trust = " --trust" if _has_foreign_code(path) else ""
    yield f"trocar verify {place}{trust}", "simulate it again and compare every state"


def _has_foreign_code(recording: Path) -> bool:
    """Return whether a recording can be simulated with trust only."""
    participants = Recording(recording).scenario().participants
    return bool(foreign_code([spec.model_dump() for spec in participants.values()], {}))
