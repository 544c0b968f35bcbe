"""`trocar check` and `trocar schema`: the plan of a scenario, and the schema of scenarios."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Mapping
from typing import Annotated

import typer
from rich.markup import escape

from hub.command_line.display import results
from hub.command_line.options import Json, Overrides, ScenarioName, with_places
from hub.planning.contacts import missing_contacts
from hub.planning.plan import Plan, PlannedParticipant
from hub.planning.scenario_file import load
from hub.planning.scenario_schema import scenario_schema
from hub.session.launch import plan_of
from schemas.readable import counted

__all__ = ["check", "schema"]

log = logging.getLogger(__name__)


def check(
    scenario: ScenarioName,
    *,
    overrides: Overrides = None,
    with_ports: Annotated[
        bool, typer.Option("--ports", help="Show all ports, and where each input comes from.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Check a scenario without starting anything, and show its participants.

    A class named as a kind is imported, after a line about the import: only the class knows the ports.
    """
    file = load(scenario, overrides or ())
    with with_places(file.source):
        plan, _ = plan_of(file.scenario, file.params)
    for missing in missing_contacts(file.params, file.scenario.bonds):
        log.warning(
            "the instrument of %s reaches '%s', and there is no contact between them: it would pass"
            " through. %s",
            missing.tool.name,
            missing.body,
            missing.remedy,
        )
    if as_json:
        typer.echo(plan.model_dump_json(indent=2))
        return
    _print_plan(plan, with_ports=with_ports)
    results.print(f"[green]{escape(str(file.source.file))} is a valid scenario.", soft_wrap=True)


def _print_plan(plan: Plan, *, with_ports: bool) -> None:
    """Print every participant with ports and sources of inputs, or with their numbers."""
    sources: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for connection in (*plan.connections, *plan.from_devices, *plan.to_devices):
        source = f"{connection.source}.{connection.source_port}"
        sources[connection.target, connection.target_port].append(source)
    for planned in plan.participants.values():
        results.print(
            f"[bold]{planned.name}[/] ({planned.role} of kind {planned.kind}) on host"
            f" {planned.host}{escape(_time(planned))}",
            soft_wrap=True,
        )
        if planned.integration:
            results.print(f"    {escape(planned.integration)}", soft_wrap=True)
        if not with_ports:
            results.print(f"    {_counts(planned, sources)}", soft_wrap=True)
        for port in planned.ports if with_ports else ():
            arrow = "->" if port.causality == "output" else "<-"
            details = (port.type, port.unit, port.frame and f"in {port.frame}")
            detail = " ".join(part for part in details if part)
            origin = ", ".join(sources.get((planned.name, port.name), ()))
            results.print(
                f"    {arrow} {port.name}  [dim]{escape(detail)}[/]{f'  from {origin}' if origin else ''}",
                soft_wrap=True,
            )
    if plan.order:
        results.print(f"order of stepping: {', '.join(plan.order)}", soft_wrap=True)


def _counts(planned: PlannedParticipant, sources: Mapping[tuple[str, str], list[str]]) -> str:
    """Return the number of ports, and the participants feeding the inputs."""
    inputs = [port.name for port in planned.ports if port.causality == "input"]
    connected = [port for port in inputs if (planned.name, port) in sources]
    origins = {one.partition(".")[0] for port in connected for one in sources[planned.name, port]}
    outputs = len(planned.ports) - len(inputs)
    text = f"{counted(outputs, 'output')}, {counted(len(inputs), 'input')}"
    return f"{text}, {len(connected)} of them from {', '.join(sorted(origins))}" if connected else text


def _time(planned: PlannedParticipant) -> str:
    """Return whether an observer has a time of its own; empty for other participants."""
    if planned.observer:
        return ", an observer: it looks in its own time, and the session does not wait for it"
    return f", in lock-step: {planned.lock_step}" if planned.lock_step else ""


def schema() -> None:
    """Print the JSON schema of a scenario, with the parameters of every installed kind."""
    typer.echo(scenario_schema(), nl=False)
