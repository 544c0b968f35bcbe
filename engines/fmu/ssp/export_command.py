"""The command `trocar export`: a scenario of FMUs becomes a system in SSP's files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hub.command_line.options import Overrides, ScenarioName, with_places

__all__ = ["app"]

app = typer.Typer()


@app.command("export")
def export_file(
    scenario: ScenarioName,
    *,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="SYSTEM.SSP", help="System of FMUs to write.")
    ],
    overrides: Overrides = None,
) -> None:
    """Write a scenario that consists of FMUs as a system (SSP 1.0, or 2.0 with FMUs of FMI 3.0)."""
    from engines.fmu.engine import FmuParams
    from engines.fmu.ssp.system_export import Link, export_system
    from hub.planning.limits import safe_text
    from hub.planning.scenario_file import load
    from hub.session.launch import plan_of
    from schemas.errors import ScenarioError
    from schemas.user_files import require_place

    if output.suffix.lower() != ".ssp":
        raise typer.BadParameter(f"'{output}' is no .ssp file", param_hint="--output")
    require_place(output)
    file = load(scenario, overrides or ())
    params = {name: one for name, one in file.params.items() if isinstance(one, FmuParams)}
    if others := [
        f"{name} ({spec.kind})" for name, spec in file.scenario.participants.items() if name not in params
    ]:
        raise ScenarioError(
            f"'{file.scenario.name}' cannot be exported: a system of SSP consists of FMUs, and these"
            f" participants are none: {', '.join(others)}"
        )
    with with_places(file.source):
        plan, _ = plan_of(file.scenario, file.params)
    if file.scenario.bonds:
        raise ScenarioError(
            f"'{file.scenario.name}' cannot be exported: SSP has no bonds, and it has"
            f" {', '.join(bond.name for bond in file.scenario.bonds)}"
        )
    links = [Link(one.source, one.source_port, one.target, one.target_port) for one in plan.connections]
    duration = file.scenario.duration
    lost = export_system(
        file.source.tree, params, links, None if duration is None else duration / 1e9, output
    )
    lost += [
        f"the connection to {one.target}.{one.target_port} extrapolates, which SSP has no word for"
        for one in plan.connections
        if one.linear
    ]
    lines = [f"not carried over: {line}" for line in lost]
    typer.echo("\n".join(safe_text(line, 500) for line in [*lines, f"wrote {output}"]))
