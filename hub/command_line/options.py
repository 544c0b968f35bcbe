"""Common arguments and options of commands."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from hub.planning.scenario_file import installed_scenarios, locate_error
from hub.planning.scenario_source import Source
from schemas.errors import ScenarioError

__all__ = [
    "Certificates",
    "Directory",
    "HubEndpoints",
    "Json",
    "Listen",
    "Overrides",
    "RecordingPath",
    "ScenarioName",
    "Trust",
    "with_places",
]

ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="NAME|PATH",
        help="An installed scenario, or the path of your own YAML file.",
        autocompletion=lambda: list(installed_scenarios()),
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="A.B=VALUE", help="Override one value of the scenario. May be repeated."),
]
RecordingPath = Annotated[
    Path,
    typer.Argument(
        metavar="RECORDING", exists=True, help="The directory of a recording, or the MCAP file in it."
    ),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help=(
            "Allow the recording to run classes, FMUs and native libraries that it names, and to read files"
            " other than those it was recorded with."
        ),
    ),
]
Directory = Annotated[
    Path | None,
    typer.Option(
        exists=True, file_okay=False, help="Where relative paths of the scenario start on this machine."
    ),
]
Listen = Annotated[
    str | None,
    typer.Option(
        metavar="ENDPOINT", help="Where to listen; default: loopback, port 7447 or the next free one."
    ),
]
HubEndpoints = Annotated[
    list[str] | None,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        help="Where a hub listens; default: all hubs of this machine. May be repeated.",
    ),
]
Certificates = Annotated[
    Path | None,
    typer.Option(
        "--certs",
        metavar="PATH",
        exists=True,
        help="The certificate, or its directory; default: the directory of this user.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


@contextmanager
def with_places(source: Source) -> Generator[None]:
    """Put file, line and column in front of scenario errors about a value."""
    try:
        yield
    except ScenarioError as error:
        raise locate_error(error, source) from error
