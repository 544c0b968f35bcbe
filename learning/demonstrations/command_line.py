"""The command `trocar demonstrate`."""

from __future__ import annotations

import os
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

import trocar
from schemas.errors import MissingExtraError, ScenarioError
from schemas.readable import counted

if TYPE_CHECKING:
    from learning.demonstrations.collection import Collection
    from learning.demonstrations.episode import Order

__all__ = ["app"]

app = typer.Typer()

_PACKAGES = {
    "joblib": "sweep",
    "av": "dataset",
    "mujoco": "dataset",
    "pandas": "dataset",
    "pyarrow": "dataset",
}


@app.command()
def demonstrate(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="NAME|PATH|ID",
            help="A scenario with a scripted expert and the measure `done`, such as pick-and-place, or an"
            " environment, such as trocar/NeedlePick-v0, which its oracle solves.",
        ),
    ],
    *,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="A new directory, or that to go on with."),
    ],
    episodes: Annotated[int, typer.Option(min=1, help="Demonstrations to try, seeds from 0.")] = 100,
    fps: Annotated[int, typer.Option(min=1, max=1000, help="Frames in a second of simulated time.")] = 30,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels of the pictures.")] = "960x540",
    task: Annotated[
        str | None, typer.Option(metavar="TEXT", help="What is done; default: the scenario's description.")
    ] = None,
    looks: Annotated[
        Literal["plain", "endoscope"] | None, typer.Option(help="Draw all pictures with these looks.")
    ] = None,
    randomise: Annotated[
        int | None,
        typer.Option(metavar="SEED", min=0, help="Vary the looks of each episode; its own seed is added."),
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=VALUE", help="Override one value in all runs. May be repeated."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Runs at a time; default: one for each core.", show_default=False),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Work on this Ray cluster, whose nodes share the directory: auto, or HOST:PORT.",
        ),
    ] = None,
) -> None:
    """Let experts show a scenario many times, and write a data set of Open-H as they go.

    Failed runs are dropped, with the reason. The same command continues an interrupted one, and may ask for
    more episodes.
    """
    for package, extra in (_PACKAGES | ({"ray": "ray"} if ray else {})).items():
        if find_spec(package) is None:
            raise MissingExtraError("'trocar demonstrate'", extra, package)
    from learning.datasets.command_line import pixels_of
    from learning.datasets.episode import Wanted
    from learning.demonstrations.collection import Collection
    from learning.demonstrations.episode import Order
    from learning.own_directory import claim_directory

    texts = {} if task is None else {"": " ".join(task.split())}
    wanted = Wanted(fps, pixels_of(size), texts, (), (), "open-h", looks, randomise)
    file = Path(scenario)
    order = Order(str(file.resolve()) if file.suffix else scenario, tuple(overrides or ()), wanted)
    _check(order)
    output.mkdir(parents=True, exist_ok=True)
    with claim_directory(output, "demonstrations"):
        settings: dict[str, Any] = {**asdict(order), "version": 1}
        collection = Collection(output, _plain(settings))
        _run(order, collection, episodes, jobs or os.cpu_count() or 1, ray)


def _plain(settings: dict[str, Any]) -> Any:
    """Return settings as JSON reads them back."""
    import json

    return json.loads(json.dumps(settings, default=sorted))


def _check(order: Order) -> None:
    """Raise ScenarioError unless a success can be told."""
    from learning.demonstrations.episode import ENVIRONMENT

    if order.scenario.startswith(ENVIRONMENT):
        from trocar.environments import ENVIRONMENTS

        if order.scenario not in ENVIRONMENTS:
            raise ScenarioError(f"no environment '{order.scenario}'; there are {', '.join(ENVIRONMENTS)}")
        return
    values = {path: value for path, _, value in (each.partition("=") for each in order.overrides)}
    loaded = trocar.load_scenario(order.scenario, set={"scene.seed": 0, **values})
    if "done" not in loaded.scenario.measure:
        raise ScenarioError(
            f"scenario '{order.scenario}' has no measure `done`, so nothing says whether a run succeeded: add"
            " `measure: {done: {kind: final, of: task.done}}` with a task"
        )


def _run(order: Order, collection: Collection, episodes: int, jobs: int, ray: str | None) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from learning.demonstrations.episode import demonstrate as run_expert
    from learning.workers import run_calls

    console = Console(stderr=True, highlight=False)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    ended = {row["seed"]: row for row in collection.rows()}
    for row in ended.values():  # of a command that was interrupted
        collection.take_up(row)
    pending = [seed for seed in range(episodes) if seed not in ended]
    calls = [(order, seed, str(collection.place(seed).resolve())) for seed in pending]
    try:
        with Progress(*columns, console=console) as bar:
            shown = bar.add_task("demonstrations", total=episodes, completed=episodes - len(pending))
            for _, row in run_calls(run_expert, calls, jobs, ray=ray):
                if note := collection.take_up(row):
                    bar.console.print(f"dropped: {note}", markup=False, soft_wrap=True)
                bar.update(shown, advance=1)
    finally:
        dropped = collection.dropped
        typer.echo(
            f"{counted(collection.episodes, 'episode')}, {counted(collection.frames, 'frame')},"
            f" {len(dropped)} of {collection.episodes + len(dropped)} dropped: {collection.directory}"
        )
    if not collection.episodes:
        raise typer.Exit(1)
