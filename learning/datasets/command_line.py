"""The command `trocar dataset`."""

from __future__ import annotations

import re
import signal
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from engines.mujoco.truth.modality import Modality, parse_modalities
from schemas.errors import MissingExtraError, RecordingError

if TYPE_CHECKING:
    from learning.datasets.episode import Wanted

__all__ = ["app", "pixels_of"]

app = typer.Typer()

_PACKAGES = ("av", "mujoco", "pandas", "PIL", "pyarrow")
_LEAST, _MOST = 64, 2048
"""Least and largest side of a picture: limits of the encoder and of the endoscope's drawing."""


@app.command()
def dataset(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="Recordings; each becomes an episode.")
    ],
    *,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="A new directory.")],
    layout: Annotated[
        Literal["lerobot-v3", "open-h", "coco", "bop"],
        typer.Option(
            "--format",
            help="LeRobot's present format, or Open-H: LeRobot v2.1 with poses of PSM1 and PSM2 in the"
            " endoscope's frame, and truths of the scene; or pictures alone, drawn and annotated: COCO's"
            " masks and keypoints, BOP's poses.",
        ),
    ] = "lerobot-v3",
    fps: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1000,
            help="Frames in a second of simulated time; default: 25, of Open-H 30.",
            show_default=False,
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            metavar="WxH",
            help="Pixels of the pictures; default: as recorded, else 640x480; of Open-H 960x540.",
            show_default=False,
        ),
    ] = None,
    task: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TEXT",
            help="What is done, in words; default: the scenario's description. SCENARIO=TEXT is for the"
            " recordings of one scenario. May be repeated.",
        ),
    ] = None,
    state: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PORT",
            help="A port, or PORT.FIELD, in observation.state; default: measured joints of all arms. May be"
            " repeated.",
        ),
    ] = None,
    action: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PORT",
            help="The same for action; default: commanded joints of all arms. May be repeated.",
        ),
    ] = None,
    looks: Annotated[
        Literal["plain", "endoscope"] | None,
        typer.Option(help="Draw all pictures with these looks; default: recorded ones where they fit."),
    ] = None,
    randomise: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=(1 << 31) - 1,
            metavar="SEED",
            help="Draw other textures, colours, light, view, smoke and surroundings for each episode, from"
            " this seed on; with --looks endoscope.",
        ),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Truth beside the pictures of a LeRobotDataset: depth,segmentation,normals,flow,keypoints,"
            " or some of these.",
        ),
    ] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Read files other than those of the recordings.")
    ] = False,
) -> None:
    """Write recordings as a LeRobotDataset: states, actions, stereo video, task text.

    Pictures missing in a session's recording are drawn from its states. An unusable recording is left out,
    and the exit code is then 1.
    """
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise typer.BadParameter(f"'{output}' exists already; name a new directory.", param_hint="--output")
    if randomise is not None and looks != "endoscope":
        raise typer.BadParameter("only endoscope looks vary: add --looks endoscope", param_hint="--randomise")
    pixels = None if size is None else pixels_of(size)
    for package in _PACKAGES:
        if find_spec(package) is None:
            raise MissingExtraError("'trocar dataset'", "dataset", "pillow" if package == "PIL" else package)
    from learning.datasets.episode import Wanted

    if layout == "open-h" and (state or action):
        raise typer.BadParameter("Open-H names its own numbers", param_hint="--state, --action")
    if layout in ("coco", "bop") and (state or action or task or truth):
        raise typer.BadParameter(
            "these belong to a LeRobotDataset", param_hint="--state --action --task --truth"
        )
    wanted = Wanted(
        fps or (30 if layout == "open-h" else 25),
        pixels,
        _tasks(task or ()),
        tuple(state or ()),
        tuple(action or ()),
        layout,
        looks,
        randomise,
        frozenset[Modality]() if truth is None else _modalities(truth),
    )
    _run(recordings, output, wanted, trust=trust)


def _tasks(given: Sequence[str]) -> dict[str, str]:
    """Return the task of each named scenario, and the task of all others below an empty name."""
    tasks: dict[str, str] = {}
    for text in given:
        named = re.fullmatch(r"([A-Za-z][A-Za-z0-9_-]*)=(.*)", text, re.DOTALL)
        scenario = named[1] if named else ""
        if scenario in tasks:
            whose = f"of '{scenario}'" if scenario else "without a scenario"
            raise typer.BadParameter(f"two tasks {whose}: expected one", param_hint="--task")
        tasks[scenario] = " ".join((named[2] if named else text).split())
    return tasks


def _modalities(text: str) -> frozenset[Modality]:
    try:
        return parse_modalities(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--truth") from None


def pixels_of(size: str) -> tuple[int, int]:
    """Return width and height of `WxH`. Raises BadParameter for anything else."""
    found = re.fullmatch(r"(\d{1,4})x(\d{1,4})", size.strip().lower())
    width, height = (int(found[1]), int(found[2])) if found else (0, 0)
    if not all(_LEAST <= side <= _MOST and side % 2 == 0 for side in (width, height)):
        raise typer.BadParameter(
            f"'{size}' is not a size: expected WIDTHxHEIGHT, such as 640x480, each an even number from"
            f" {_LEAST} to {_MOST}",
            param_hint="--size",
        )
    return width, height


@contextmanager
def _raise_on_sigterm() -> Generator[None]:
    """Let SIGTERM and the end of the terminal interrupt the main thread, as Ctrl-C does."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before: dict[int, Any] = {
        number: signal.signal(number, interrupt) for number in (getattr(signal, name) for name in names)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _run(recordings: list[Path], output: Path, wanted: Wanted, *, trust: bool) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from learning.datasets.annotated import Annotated
    from learning.datasets.conversion import Conversion
    from learning.own_directory import NewDirectory

    console = Console(stderr=True, highlight=False)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with NewDirectory(output, "data set") as new:
        is_annotated = wanted.format in ("coco", "bop")
        conversion = (Annotated if is_annotated else Conversion)(new.path, wanted, trust=trust)
        try:
            with _raise_on_sigterm(), conversion as made, Progress(*columns, console=console) as bar:
                counted = bar.add_task("recordings", total=len(recordings))
                for path in recordings:
                    if note := made.add(path):
                        bar.console.print(note, markup=False, soft_wrap=True)
                    bar.update(counted, advance=1)
        except OSError as error:
            raise RecordingError(f"'{output}' cannot be written, and is not made: {error}") from error
        finally:
            if conversion.is_whole:
                new.publish()
        typer.echo(f"{conversion.summary()}: {output}")
        for text, episodes in conversion.tasks.items():
            typer.echo(f"  {episodes} x {text!r}")  # of a stranger's recording: escapes are shown
        for name in conversion.tasks_without_recording:
            console.print(f"--task {name}=...: no recording is of that scenario", markup=False)
    if conversion.left_out:
        raise typer.Exit(1)
