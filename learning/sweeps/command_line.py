"""The command `trocar sweep`."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from schemas.errors import MissingExtraError
from schemas.readable import counted

if TYPE_CHECKING:
    from learning.sweeps.sweep import Sweep

__all__ = ["app"]

app = typer.Typer()

_PACKAGES = {"joblib": "sweep", "pyarrow": "sweep", "matplotlib": "sweep"}


@app.command()
def sweep(
    scenario: Annotated[
        str,
        typer.Argument(metavar="NAME|PATH", help="An installed scenario, or the path of your own YAML file."),
    ],
    *,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", help="A new directory, or that of the sweep to go on with."
        ),
    ],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH=VALUES",
            help="A parameter and its values, FIRST..LAST:COUNT or VALUE,VALUE. May be repeated.",
        ),
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=VALUE", help="Override one value in all trials. May be repeated."),
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, help="Trials of each combination.")] = 1,
    seed: Annotated[
        str | None,
        typer.Option(metavar="PATH", help="A parameter that gets the number of the repetition, from 0."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Trials at a time; default: one for each core.", show_default=False),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Run the trials on this Ray cluster, from one of its nodes: auto, or HOST:PORT.",
        ),
    ] = None,
    record: Annotated[bool, typer.Option(help="Keep a recording of each trial.")] = True,
) -> None:
    """Run a scenario many times with varied values, and write a table of all trials.

    Each trial is a process. A trial that fails is repeated once and marked. The same command continues an
    interrupted sweep.
    """
    needed = _PACKAGES | ({"ray": "ray"} if ray else {})
    for package, extra in needed.items():
        if find_spec(package) is None:
            raise MissingExtraError("'trocar sweep'", extra, package)
    from learning.own_directory import claim_directory
    from learning.sweeps.sweep import Sweep
    from learning.sweeps.variation import parse

    made = Sweep(
        scenario,
        tuple(parse(text) for text in vary or ()),
        output,
        repeat=repeat,
        seed=seed,
        overrides=tuple(overrides or ()),
        recorded=record,
    )
    made.check()
    with claim_directory(output, "sweep"):
        made.open()
        _run(made, jobs or os.cpu_count() or 1, ray)


def _run(sweep: Sweep, jobs: int, ray: str | None) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from learning.sweeps.results import write_plots, write_table

    console = Console(stderr=True, highlight=False)
    total, pending = len(sweep.trials), len(sweep.pending())
    failed = sum(row["error"] is not None for row in sweep.rows())
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    try:
        with Progress(*columns, console=console) as bar:
            task = bar.add_task("trials", total=total, completed=total - pending)
            for row in sweep.run(jobs, ray=ray):
                if row["error"] is not None:
                    failed += 1
                    bar.console.print(f"a trial {row['state']}: {row['error']}", markup=False)
                bar.update(task, advance=1, description=f"trials ({failed} failed)" if failed else "trials")
    finally:
        if rows := sweep.rows():
            write_table(rows, sweep.variations, sweep.directory / "results.parquet")
            drawn = write_plots(rows, sweep.variations, sweep.directory / "results.png")
            typer.echo(
                f"{len(rows)} of {counted(total, 'trial')}, {failed} failed:"
                f" {sweep.directory / 'results.parquet'}" + (", results.png" if drawn else "")
            )
    if failed:
        raise typer.Exit(1)
