"""`trocar doctor`: working and missing parts of this machine."""

from __future__ import annotations

from collections.abc import Iterable

import typer
from rich.console import Console
from rich.markup import escape

from hub import doctor as examination
from hub.command_line.options import Json

__all__ = ["doctor"]


def doctor(*, as_json: Json = False) -> None:
    """Show the working parts of this machine, and remedies for all others."""
    findings = examination.examine()
    if as_json:
        typer.echo(examination.as_json(findings))
    else:
        _print(findings)
    if not all(finding.works for finding in findings if finding.needed):
        raise typer.Exit(1)


def _print(findings: Iterable[examination.Finding]) -> None:
    out = Console(highlight=False, soft_wrap=True)
    for finding in findings:
        mark = "[green]works  [/]" if finding.works else "[yellow]missing[/]"
        out.print(f"{mark}  {finding.area:<10}  {finding.name:<14}", escape(finding.detail))
        if not finding.works:
            out.print(f"{'':37}to repair it: {escape(finding.remedy)}")
