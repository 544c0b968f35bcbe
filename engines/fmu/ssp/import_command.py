"""The command `trocar import`: a system of FMUs in SSP's files becomes a scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from schemas.readable import counted

__all__ = ["app"]

app = typer.Typer()


@app.command("import")
def import_file(
    file: Annotated[
        Path, typer.Argument(metavar="SYSTEM.SSP", help="System of FMUs (SSP 1.0 or 2.0, a .ssp file).")
    ],
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIRECTORY", help="New directory; default: the name of the file, here."
        ),
    ] = None,
) -> None:
    """Make a scenario of a system of FMUs, and say what could not be carried over."""
    from engines.fmu.ssp.system_import import import_system
    from hub.planning.limits import safe_text
    from hub.planning.scenario_file import load
    from hub.session.launch import plan_of
    from schemas.errors import ScenarioError

    if file.suffix.lower() != ".ssp":
        raise typer.BadParameter(
            f"'{file}' is no .ssp file; for meshes and label maps see `trocar organs import`",
            param_hint="SYSTEM.SSP",
        )
    imported = import_system(file, output or Path(file.stem))
    try:
        checked = load(str(imported.file))
        plan_of(checked.scenario, checked.params)
    except ScenarioError as error:
        raise ScenarioError(
            f"{error}\n'{imported.file}' is written, and does not run as it is: correct it there"
        ) from error
    lines = [*imported.notes]
    lines += [f"not carried over: {line}" for line in imported.lost]
    number = len(imported.scenario["participants"])
    lines += [
        f"wrote {imported.file}: {counted(number, 'FMU')},"
        f" {counted(len(imported.scenario.get('connections', ())), 'connection')}",
        f"next: trocar run {imported.file}",
    ]
    typer.echo("\n".join(safe_text(line, 500) for line in lines))
