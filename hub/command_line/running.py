"""`trocar run`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from hub.command_line.display import RunProgress, console, show
from hub.command_line.hosting import Certificates
from hub.command_line.scenarios import Json, Overrides, ScenarioName, locating
from hub.planning.scenario_file import load
from hub.session.launch import launch
from hub.transport.endpoints import split_endpoints

__all__ = ["run"]


def _is_new(directory: Path | None) -> Path | None:
    if (
        directory is not None
        and directory.exists()
        and not (directory.is_dir() and not any(directory.iterdir()))
    ):
        raise typer.BadParameter(f"'{directory}' is there already; name a new directory.")
    return directory


def run(
    scenario: ScenarioName,
    *,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", callback=_is_new, help="Record to a new rosbag2 directory.")
    ] = None,
    overrides: Overrides = None,
    pace: Annotated[
        Literal["fast", "realtime"] | None, typer.Option(help="Instead of the scenario's own.")
    ] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            help=(
                "Where to listen beside loopback, such as tls/0.0.0.0:7447; or where on loopback. May be"
                " repeated."
            ),
        ),
    ] = None,
    certs: Certificates = None,
    one_host: Annotated[
        bool, typer.Option("--one-host", help="Run every participant in the hub's process.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Run a scenario."""
    file = load(scenario, [*(overrides or ()), *([f"pace={pace}"] if pace else ())])
    inside, outside = split_endpoints(listen or ())
    with locating(file.source):
        session = launch(
            file, endpoint=inside, outside=outside, certificates=certs, record=record, one_host=one_host
        )
        with RunProgress(session.scenario) as progress:
            summary = session.run(progress)
    show(summary.as_dict(), as_json=as_json)
    if summary.recording_complete is False:
        console.print("[bold red]error:[/] the recording is incomplete")
        raise typer.Exit(1)
