"""Commands that only look: `check`, `ls`, `doctor`, `schema`."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from hub import doctor as doctor_module
from hub import registry
from hub.command_line.display import console, table
from hub.command_line.scenarios import Json, Overrides, ScenarioName, locating
from hub.scenario_file import load
from hub.scenario_schema import scenario_schema

__all__ = ["check", "doctor", "ls", "schema"]


def check(scenario: ScenarioName, *, overrides: Overrides = None, as_json: Json = False) -> None:
    """Check a scenario without starting anything, and show its ports and wiring."""
    from hub.plan import make_plan

    loaded = load(scenario, overrides or ())
    specs = loaded.scenario.participants
    with locating(loaded.source):
        participants = {name: registry.load(spec.kind)(name, loaded.params[name]) for name, spec in specs.items()}
        plan = make_plan(loaded.scenario, participants, {name: registry.kinds()[spec.kind].role for name, spec in specs.items()})
    if as_json:
        typer.echo(plan.model_dump_json(indent=2))
        return
    rows = [(m.name, m.kind, m.role, m.host, port.name, port.causality, port.type, port.unit, port.frame) for m in plan.members.values() for port in m.ports]
    console.print(table(rows, "participant", "kind", "role", "host", "port", "causality", "type", "unit", "frame"))
    console.print(f"[green]{loaded.source.file} is a valid scenario.")


def ls(
    *,
    connect: Annotated[list[str] | None, typer.Option(metavar="ENDPOINT", help="Where a hub listens; by default all of this machine's are asked.")] = None,
    as_json: Json = False,
) -> None:
    """List the sessions that are running, and their participants."""
    from hub.endpoint import listening_endpoints
    from hub.live import live_sessions

    sessions = live_sessions(connect or listening_endpoints())
    if as_json:
        members = [{"session": s.session, "participants": [p.model_dump() for p in s.participants]} for s in sessions]
        typer.echo(json.dumps(members, indent=2))
        return
    rows = [(s.session, s.state, p.name, p.role, p.host, p.pid, p.step) for s in sessions for p in s.participants]
    Console(highlight=False).print(table(rows, "session", "state", "name", "role", "host", "pid", "step") if rows else "no session is running")


def doctor(*, as_json: Json = False) -> None:
    """Show what works on this machine, and the line that mends what does not."""
    findings = doctor_module.examine()
    if as_json:
        typer.echo(doctor_module.as_json(findings))
    else:
        _print_findings(findings)
    if not all(f.works for f in findings if f.needed):
        raise typer.Exit(1)


def _print_findings(findings: list[doctor_module.Finding]) -> None:
    out = Console(highlight=False, soft_wrap=True)
    for finding in findings:
        mark = "[green]works  [/]" if finding.works else "[yellow]missing[/]"
        out.print(f"{mark}  {finding.area:<10}  {finding.name:<14}", escape(finding.detail))
        if not finding.works:
            out.print(f"{'':37}to mend it: {escape(finding.remedy)}")


def schema() -> None:
    """Print the JSON schema of a scenario, with the parameters of every installed kind."""
    typer.echo(scenario_schema(), nl=False)
