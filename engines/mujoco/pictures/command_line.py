"""The command `trocar render`: a picture of any moment of a recording."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer

from schemas.errors import MissingExtraError

__all__ = ["app"]

app = typer.Typer()

_MOST_PIXELS = 1024


@app.command()
def render(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING", exists=True, help="A recording's directory, or the MCAP file in it."
        ),
    ],
    *,
    output: Annotated[Path, typer.Option("--output", "-o", help="Picture to write: .png or .jpg.")],
    time: Annotated[float, typer.Option(min=0.0, metavar="S", help="Simulated time, in seconds.")] = 0.0,
    camera: Annotated[
        Literal["overview", "left", "right"],
        typer.Option(help="From outside, or with an eye of the endoscope."),
    ] = "overview",
    position: Annotated[
        str | None,
        typer.Option("--from", metavar="X,Y,Z", help="Where the overview looks from, m in the world."),
    ] = None,
    target: Annotated[
        str | None, typer.Option("--at", metavar="X,Y,Z", help="Where the overview looks at, m in the world.")
    ] = None,
    width: Annotated[int, typer.Option(min=16, max=_MOST_PIXELS, help="Pixels.")] = 800,
    height: Annotated[int, typer.Option(min=16, max=_MOST_PIXELS, help="Pixels.")] = 600,
    robot: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Whose scene, where several participants are of kind mujoco."),
    ] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Read files other than those it was recorded with.")
    ] = False,
) -> None:
    """Draw the scene of a recording at one moment, with its soft bodies and markers."""
    if output.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise typer.BadParameter(f"'{output}' is not a picture: .png or .jpg", param_hint="--output")
    for package in ("mujoco", "PIL"):
        if find_spec(package) is None:
            raise MissingExtraError("'trocar render'", "mujoco", "pillow" if package == "PIL" else package)
    from PIL import Image

    from engines.mujoco.pictures.recorded_scene import RecordedScene
    from hub.recording.recording import Recording

    scene = RecordedScene(Recording(recording), robot, trust=trust)
    eyes = None if position is None else _parse_point(position, "--from")
    picture = scene.picture(
        round(time * 1e9),
        camera,
        (width, height),
        eyes,
        None if target is None else _parse_point(target, "--at"),
    )
    Image.fromarray(picture).save(output)
    typer.echo(output)


def _parse_point(text: str, option: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(number) for number in text.replace(",", " ").split())
    except ValueError:
        raise typer.BadParameter(
            f"'{text}' is not a point; write x,y,z in metres", param_hint=option
        ) from None
    return x, y, z
