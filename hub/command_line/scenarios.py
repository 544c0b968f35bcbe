"""What commands that take a scenario have in common."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Annotated

import typer

from hub.planning.scenario_file import installed_scenarios, located
from hub.planning.scenario_source import Source
from schemas.errors import ScenarioError

__all__ = ["Json", "Listen", "Overrides", "ScenarioName", "locating"]

ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="NAME|PATH",
        help="An installed scenario, or a YAML file of your own.",
        autocompletion=lambda: list(installed_scenarios()),
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="A.B=VALUE", help="Override one value of the scenario. May be repeated."),
]
Listen = Annotated[
    str | None,
    typer.Option(
        metavar="ENDPOINT", help="Where to listen; by default on loopback, port 7447 or the next free one."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


@contextmanager
def locating(source: Source) -> Generator[None]:
    """Put file, line and column in front of scenario errors that say which value they are about."""
    try:
        yield
    except ScenarioError as error:
        raise located(error, source) from error
