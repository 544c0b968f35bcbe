"""Commands that only look: `check`, `ls`, `doctor`, `schema`."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from hub import doctor as doctor_module
from hub.command_line.display import console, table
from hub.command_line.scenarios import Json, Overrides, ScenarioName, locating
from hub.launch import plan_of
from hub.plan import Plan
from hub.scenario_file import load
from hub.scenario_schema import scenario_schema

__all__ = ["check", "doctor", "ls", "schema"]


def check(scenario: ScenarioName, *, overrides: Overrides = None, as_json: Json = False) -> None:
    """Check a scenario without starting anything, and show its ports and wiring."""
    file = load(scenario, overrides or ())
    with locating(file.source):
        plan, _ = plan_of(file.scenario, file.params)
    if as_json:
        typer.echo(plan.model_dump_json(indent=2))
        return
    _print_plan(plan)
    console.print(f"[green]{file.source.file} is a valid scenario.")


def _print_plan(plan: Plan) -> None:
    """Print every participant with its ports, and who feeds its inputs."""
    feeds = {(link.target, link.target_port): f"{link.source}.{link.source_port}" for link in plan.links}
    feeds |= {(inlet.target, inlet.target_port): f"{inlet.device}.{inlet.device_port}" for inlet in plan.inlets}
    feeds |= {(outlet.device, outlet.device_port): f"{outlet.source}.{outlet.source_port}" for outlet in plan.outlets}
    for member in plan.members.values():
        console.print(f"[bold]{member.name}[/] ({member.role} of kind {member.kind}) on host {member.host}")
        for port in member.ports:
            detail = " ".join(part for part in (port.type, port.unit, port.frame and f"in {port.frame}") if part)
            source = feeds.get((member.name, port.name))
            console.print(
                f"    {'->' if port.causality == 'output' else '<-'} {port.name}  [dim]{detail}[/]{f'  from {source}' if source else ''}", soft_wrap=True
            )
    console.print(f"they step in the order {', '.join(plan.order)}")


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
