"""Commands that only look: `check`, `ls`, `doctor`, `schema`."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from hub import doctor as doctor_module
from hub.command_line.display import LATENCY_COLUMNS, console, latency_rows, table
from hub.command_line.hosting import Certificates
from hub.command_line.scenarios import Json, Overrides, ScenarioName, locating
from hub.observation.latency import by_way
from hub.planning.plan import Plan
from hub.planning.scenario_file import load
from hub.planning.scenario_schema import scenario_schema
from hub.session.launch import plan_of
from schemas.trocar_msgs import SessionStatus

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
    feeds: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for link in plan.connections:
        feeds[link.target, link.target_port].append(f"{link.source}.{link.source_port}")
    for inlet in plan.from_devices:
        feeds[inlet.target, inlet.target_port].append(f"{inlet.source}.{inlet.source_port}")
    for outlet in plan.to_devices:
        feeds[outlet.target, outlet.target_port].append(f"{outlet.source}.{outlet.source_port}")
    for planned in plan.participants.values():
        console.print(
            f"[bold]{planned.name}[/] ({planned.role} of kind {planned.kind}) on host {planned.host}"
        )
        for port in planned.ports:
            detail = " ".join(
                part for part in (port.type, port.unit, port.frame and f"in {port.frame}") if part
            )
            source = ", ".join(feeds.get((planned.name, port.name), ()))
            console.print(
                f"    {'->' if port.causality == 'output' else '<-'} {port.name} "
                f" [dim]{detail}[/]{f'  from {source}' if source else ''}",
                soft_wrap=True,
            )
    console.print(f"they step in the order {', '.join(plan.order)}")


def ls(
    *,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="Where a hub listens; by default all of this machine's are asked."
        ),
    ] = None,
    certs: Certificates = None,
    as_json: Json = False,
) -> None:
    """List the sessions that are running: participants, the clocks and links of devices, and how long things
    take.
    """
    from hub.remote.live_sessions import live_sessions
    from hub.transport.endpoints import listening_endpoints

    sessions = live_sessions(connect or listening_endpoints(), certs)
    if as_json:
        typer.echo(json.dumps([_session_row(status) for status in sessions], indent=2))
        return
    out = Console(highlight=False)
    if not sessions:
        out.print("no session is running")
        return
    rows = [
        (s.session, s.state, p.name, p.role, p.host, p.pid, p.step) for s in sessions for p in s.participants
    ]
    out.print(table(rows, "session", "state", "name", "role", "host", "pid", "step"))
    for columns, of_session in ((_DEVICE_COLUMNS, _device_rows), (LATENCY_COLUMNS, _latency_rows)):
        if told := [(status.session, *row) for status in sessions for row in of_session(status)]:
            out.print()
            out.print(table(told, "session", *columns))


_DEVICE_COLUMNS = ("device", "its clock to the hub's", "known within", "link")


def _session_row(status: SessionStatus) -> dict[str, Any]:
    shown = {"participants": status.participants, "devices": status.devices, "latency": status.latencies}
    return {"session": status.session} | {
        name: [one.model_dump() for one in found] for name, found in shown.items()
    }


def _device_rows(status: SessionStatus) -> Iterator[tuple[str, ...]]:
    for device in status.devices:
        known = device.round_trip_ns >= 0
        offset = f"{device.offset_ns / 1e6:+.3f} ms" if known else "the same"
        yield (
            device.device,
            offset,
            f"{device.round_trip_ns / 2e6:.3f} ms" if known else "-",
            device.link or "-",
        )


def _latency_rows(status: SessionStatus) -> Iterator[tuple[object, ...]]:
    return latency_rows(by_way(status.latencies))


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
