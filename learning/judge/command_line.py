"""The command `trocar judge`."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from schemas.errors import MissingExtraError, ScenarioError

if TYPE_CHECKING:
    from learning.judge.verdict import Verdict

__all__ = ["app"]

app = typer.Typer()

_LARGEST_CONTRACT = 100_000
"""Bytes of a file with a contract."""
_SEEDS = 50
"""Episodes of each exercise and difficulty if no other number is asked for."""
_PACKAGES = ("gymnasium", "joblib", "pyarrow", "scipy")


@app.command()
def judge(
    *,
    policy: Annotated[
        str | None,
        typer.Option(
            metavar="POLICY",
            help="expert, random, a backend's address such as openpi://HOST:8000, or MODULE:NAME of a"
            " class of your own.",
        ),
    ] = None,
    contract: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", exists=True, help="Contract with a backend, YAML, as `contract` of a scene."
        ),
    ] = None,
    execute: Annotated[
        int, typer.Option(min=1, help="Rows of a backend's answer before the next question.")
    ] = 5,
    suite: Annotated[
        str, typer.Option(help="training, suturing, tissue, all, operation, or exercises, with commas.")
    ] = "suturing",
    difficulty: Annotated[
        str,
        typer.Option(
            help="nominal, joint-errors, camera-offset, looks, latency-100, -200, -300, with commas; or all."
        ),
    ] = "nominal",
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Episodes of each exercise and difficulty; default: 50, with an operation 5.",
            show_default=False,
        ),
    ] = None,
    first_seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first episode, where a policy has seen the first seeds.")
    ] = 0,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="A new directory, or that of the verdict to go on with."
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Workers at a time; default: one for each core.", show_default=False),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Work on this Ray cluster, from one of its nodes: auto, or HOST:PORT."
        ),
    ] = None,
    record: Annotated[bool, typer.Option(help="Keep a recording of each trial.")] = True,
    compare: Annotated[
        tuple[Path, Path] | None,
        typer.Option(metavar="DIR DIR", help="Compare two verdicts, pair by pair of seeds."),
    ] = None,
) -> None:
    """Judge a policy on suites of exercises: success with intervals, classes of failure, recordings.

    Each trial can be appealed: `trocar verify` re-simulates its recording without the policy. The same
    command continues an interrupted verdict.
    """
    for package in (*_PACKAGES, *(("ray",) if ray else ())):
        if find_spec(package) is None:
            raise MissingExtraError("'trocar judge'", "ray" if package == "ray" else "judge", package)
    if compare is not None:
        _compare(*compare)
        return
    if policy is None or output is None:
        raise ScenarioError("a verdict needs --policy and --output; or compare two with --compare DIR DIR")
    from learning.judge.difficulties import difficulties_of
    from learning.judge.policies import PolicyAddress
    from learning.judge.suites import exercises_of
    from learning.judge.verdict import Verdict
    from learning.own_directory import claim_directory

    sys.path.insert(0, str(Path.cwd()))  # a policy of one's own lies where the command is typed
    address = PolicyAddress(policy, _stated(contract), execute)
    exercises, difficulties = exercises_of(suite), difficulties_of(difficulty)
    count = _seeds_of(exercises) if seeds is None else seeds
    verdict = Verdict(address, exercises, difficulties, count, output, first_seed, recorded=record)
    _check(verdict)
    with claim_directory(output, "verdict"):
        verdict.open()
        _run(verdict, jobs or os.cpu_count() or 1, ray)


def _stated(file: Path | None) -> dict[str, Any] | None:
    """Return the entries of a contract that a file states."""
    from robots.policies.contract import Contract
    from schemas.yaml_model import load_yaml_model

    if file is None:
        return None
    read = load_yaml_model(Contract, file, largest=_LARGEST_CONTRACT, writer="you", error=ScenarioError)
    return read.model_dump(mode="json", exclude_unset=True)


def _seeds_of(exercises: tuple[str, ...]) -> int:
    """Return the number of seeds where none is asked for."""
    from learning.judge.operations import OPERATIONS

    return min([_SEEDS, *(OPERATIONS[name].seeds for name in exercises if name in OPERATIONS)])


def _check(verdict: Verdict) -> None:
    """Raise ScenarioError if the policy cannot be tried in one of the exercises."""
    from learning.judge.operations import OPERATIONS
    from learning.judge.policies import open_policy

    if any(name not in OPERATIONS for name in verdict.exercises):
        open_policy(verdict.policy)
    for name in verdict.exercises:
        for difficulty in verdict.difficulties if name in OPERATIONS else ():
            OPERATIONS[name].order(verdict.policy, difficulty, verdict.first_seed).check()


def _compare(first: Path, second: Path) -> None:
    from learning.judge.comparison import compare, comparison_text

    for found in compare(first, second):
        typer.echo(comparison_text(found))


def _run(verdict: Verdict, jobs: int, ray: str | None) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True, highlight=False)
    total, pending = len(verdict.trials), len(verdict.pending())
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    try:
        with Progress(*columns, console=console) as bar:
            task = bar.add_task("trials", total=total, completed=total - pending)
            for row in verdict.run(jobs, ray=ray):
                if row["error"] is not None:
                    bar.console.print(f"{row['exercise']}, seed {row['seed']}: {row['error']}", markup=False)
                bar.advance(task)
    finally:
        _report(verdict)


def _report(verdict: Verdict) -> None:
    from learning.judge.page import write_page
    from learning.judge.summary import results_of
    from learning.judge.table import write_table

    if not (rows := verdict.rows()):
        return
    write_table(rows, verdict.directory / "trials.parquet")
    write_page(verdict.description, rows, verdict.directory / "index.html")
    for result in results_of(rows):
        worst = ", ".join(f"{kind} {count}" for kind, count in result.failures.items())
        typer.echo(f"{result.exercise}, {result.difficulty}: {result.rate}" + (f"; {worst}" if worst else ""))
    typer.echo(f"{verdict.directory / 'index.html'}, trials.parquet")
