"""`trocar run`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Literal

import typer

from hub.command_line.display import RunProgress, console
from hub.command_line.last_runs import remember_run
from hub.command_line.open_page import page_of_this_process
from hub.command_line.options import Certificates, Json, Overrides, ScenarioName, with_places
from hub.command_line.record_option import Overwrite, RecordTo, delete_earlier, recording_directory
from hub.command_line.run_summary import show_summary
from hub.command_line.scenarios import print_scenarios
from hub.observation.summary import Summary
from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import launch
from hub.transport.loopback_port import listening_ports

__all__ = ["Everything", "Listening", "OneHost", "require_complete", "run"]


Listening = Annotated[
    list[str] | None,
    typer.Option(
        "--listen",
        metavar="ENDPOINT",
        help=(
            "Where to listen besides loopback, such as tls/0.0.0.0:7447, or the endpoint on loopback."
            " May be repeated."
        ),
    ),
]
Everything = Annotated[
    bool, typer.Option("--all", help="Also show latencies, steps, energy, and scores without a value.")
]
OneHost = Annotated[bool, typer.Option("--one-host", help="Run every participant in the hub's process.")]


_PAGE_DEVICES = ("browser", "browser-pair")
"""Kinds of devices led from a page."""


def require_complete(summary: Summary) -> None:
    """End with exit code 1 if a recording was asked for and is not complete."""
    if summary.recording_complete is False:
        console.print("[bold red]error:[/] the recording is incomplete")
        raise typer.Exit(1)


def run(
    scenario: ScenarioName = "",
    *,
    record: RecordTo = None,
    overwrite: Overwrite = False,
    overrides: Overrides = None,
    pace: Annotated[
        Literal["fast", "realtime"] | None, typer.Option(help="Replace the pace of the scenario.")
    ] = None,
    programs: Annotated[
        bool,
        typer.Option(
            "--programs",
            help="Let programs lead the arms (trocar.connect), in real time unless --pace is given.",
        ),
    ] = False,
    listen: Listening = None,
    certs: Certificates = None,
    one_host: OneHost = False,
    profile: Annotated[
        bool, typer.Option("--profile", help="Show where the time goes: by participant, process and phase.")
    ] = False,
    open_page: Annotated[
        bool | None,
        typer.Option(
            "--open/--no-open",
            help="Show the session on a page in the browser; default: where a page leads a device.",
        ),
    ] = None,
    everything: Everything = False,
    as_json: Json = False,
) -> None:
    """Run a scenario, and show a summary; without a name, list the scenarios."""
    if not scenario:
        print_scenarios()
        return
    name = Path(scenario).stem
    directory = recording_directory(record, name, overwrite=overwrite)
    pace = pace or ("realtime" if programs else None)
    as_installed = scenario in installed_scenarios() and not (overrides or pace or one_host or profile)
    file = load(scenario, [*(overrides or ()), *([f"pace={pace}"] if pace else ())], programs=programs)
    inside, outside = listening_ports(listen or ())
    with with_places(file.source):
        session = launch(
            file,
            endpoint=inside,
            outside=outside,
            certificates=certs,
            record=directory,
            one_host=one_host,
            profile=profile,
        )
        delete_earlier(directory)
        led = any(spec.kind in _PAGE_DEVICES for spec in file.scenario.participants.values())
        with page_of_this_process() if open_page or (led and open_page is None) else nullcontext():
            with RunProgress(session.scenario, name) as progress:
                summary = session.run(progress)
            if as_installed:
                remember_run(name, summary)
            show_summary(
                name, summary, again=f"trocar run {scenario}", everything=everything, as_json=as_json
            )
    require_complete(summary)
