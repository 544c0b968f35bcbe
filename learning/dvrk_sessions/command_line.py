"""The command `trocar recording export`."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer

from learning.datasets.command_line import pixels_of
from schemas.errors import MissingExtraError

__all__ = ["app"]

app = typer.Typer(help="Recordings in the forms of other programs.", no_args_is_help=True)


@app.callback()
def recording() -> None:
    """Recordings in the forms of other programs."""


@app.command()
def export(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Its directory, or an .mcap file.")],
    *,
    layout: Annotated[
        Literal["dvrk-data"],
        typer.Option("--format", help="A session of dvrk_data, the recorder of the dVRK."),
    ] = "dvrk-data",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="A new directory; by default <recording>-dvrk-data beside the recording.",
        ),
    ] = None,
    gateway: Annotated[
        str | None, typer.Option(help="Whose topics, where a session has several gateways to ROS.")
    ] = None,
    fps: Annotated[
        int, typer.Option(min=1, max=1000, help="Drawn pictures in a second, if none are recorded.")
    ] = 30,
    size: Annotated[
        str, typer.Option(metavar="WxH", help="Pixels of drawn pictures, if none are recorded.")
    ] = "640x480",
    trust: Annotated[
        bool, typer.Option("--trust", help="Read files other than those of the recording.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")] = False,
) -> None:
    """Write a recording as a session of dvrk_data: ROS bag, stereo video, times of all frames, events.

    Pictures missing in the recording are drawn from its states. `trocar score`, `trocar relive` and `ros-bag`
    read such sessions, and sessions of the real recorder.
    """
    del layout
    pixels = pixels_of(size)
    for package in ("av", "mujoco", "PIL"):
        if find_spec(package) is None:
            raise MissingExtraError(
                "'trocar recording export'", "dataset", "pillow" if package == "PIL" else package
            )
    from learning.dvrk_sessions.export import Pictures, export_session
    from learning.own_directory import NewDirectory
    from trocar import Recording

    stem = recording.parent if recording.is_file() else recording
    target = output or stem.with_name(f"{stem.resolve().name}-dvrk-data")
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise typer.BadParameter(f"'{target}' exists already; name a new directory.", param_hint="--output")
    opened = Recording(recording)
    with NewDirectory(target, "dvrk_data session") as new:
        done = export_session(opened, new.path, gateway, Pictures(fps, pixels), trust=trust)
        new.publish()
    shown = asdict(done) | {"session": str(target)}
    if as_json:
        typer.echo(json.dumps(shown, indent=2))
        return
    for key, value in shown.items():
        typer.echo(f"{key:11}{value}")
