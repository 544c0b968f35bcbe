"""`trocar doctor`: a verdict, missing parts of this machine, and remedies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer
from rich.markup import escape

from hub import doctor as examination
from hub.command_line.display import results, show_commands
from hub.command_line.options import Json
from hub.planning.scenario_file import installed_scenarios

__all__ = ["doctor"]


def doctor(
    *,
    everything: Annotated[bool, typer.Option("--all", help="Also show all working parts.")] = False,
    as_json: Json = False,
) -> None:
    """Show whether this machine runs the scenarios, the missing parts, and their remedies."""
    findings = examination.examine()
    works = all(finding.works for finding in findings if finding.needed)
    if as_json:
        typer.echo(examination.as_json(findings))
    else:
        results.print(_verdict(works=works), soft_wrap=True)
        _print_findings(findings, everything=everything)
    if not works:
        raise typer.Exit(1)


def _verdict(*, works: bool) -> str:
    if not works:
        return "[red]Nothing runs on this machine before the needed parts below are repaired.[/]"
    blocked = examination.blocked_scenarios()
    number = len(installed_scenarios())
    if not blocked:
        return f"[green]This machine runs all {number} scenarios.[/]"
    names = ", ".join(f"{name} ({reason})" for name, reason in blocked.items())
    return (
        f"[yellow]This machine runs {number - len(blocked)} of {number} scenarios, but not[/] {escape(names)}"
    )


def _print_findings(findings: Sequence[examination.Finding], *, everything: bool) -> None:
    shown = [finding for finding in findings if everything or not finding.works]
    if shown:
        results.print()
    for finding in shown:
        mark = "[green]works  [/]" if finding.works else "[yellow]missing[/]"
        line = f"{mark}  {finding.area:<10}  {finding.name:<14} {escape(finding.detail)}"
        results.print(line, soft_wrap=True)
        if not finding.works:
            results.print(f"{'':37}to repair it: {escape(finding.remedy)}", soft_wrap=True)
    if not everything:
        results.print()
        show_commands([("trocar doctor --all", f"also the {len(findings) - len(shown)} working parts")])
