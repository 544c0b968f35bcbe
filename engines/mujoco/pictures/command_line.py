"""The commands `trocar render` and `trocar film`: a picture of any moment of a recording, and a film."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from engines.mujoco.truth.modality import Modality, parse_modalities
from schemas.errors import MissingExtraError

if TYPE_CHECKING:
    from engines.mujoco.pictures.recorded_scene import RecordedScene

__all__ = ["film_app", "render_app"]

render_app, film_app = typer.Typer(), typer.Typer()

_MOST_PIXELS = 4096

Recorded = Annotated[
    Path,
    typer.Argument(metavar="RECORDING", exists=True, help="A recording's directory, or the MCAP file in it."),
]
CameraName = Annotated[
    Literal["overview", "left", "right"], typer.Option(help="From outside, or with an eye of the endoscope.")
]
Position = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="X,Y,Z",
        help="Where the overview looks from, m in the world; default: where the arms hide least.",
    ),
]
Target = Annotated[
    str | None, typer.Option("--at", metavar="X,Y,Z", help="Where the overview looks at, m in the world.")
]
Pixels = Annotated[int, typer.Option(min=16, max=_MOST_PIXELS, help="Pixels.")]
Robot = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Whose scene, where several participants are of kind mujoco."),
]
LooksName = Annotated[
    Literal["plain", "endoscope"] | None,
    typer.Option(
        help="endoscope: light, textures and surroundings as an endoscope sees them, by Filament; default:"
        " looks of the recorded camera."
    ),
]
Trusted = Annotated[bool, typer.Option("--trust", help="Read files other than those it was recorded with.")]


@render_app.command()
def render(
    recording: Recorded,
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Picture to write, .png or .jpg, or with --modalities a directory; default: beside the"
            " recording.",
        ),
    ] = None,
    time: Annotated[float, typer.Option(min=0.0, metavar="S", help="Simulated time, in seconds.")] = 0.0,
    modalities: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Truth beside the picture: depth,segmentation,normals,flow,keypoints, or some of these.",
        ),
    ] = None,
    step: Annotated[
        float, typer.Option(min=1e-4, metavar="S", help="Time until the picture to which the flow leads.")
    ] = 0.04,
    camera: CameraName = "overview",
    position: Position = None,
    target: Target = None,
    width: Pixels = 800,
    height: Pixels = 600,
    robot: Robot = None,
    looks: LooksName = None,
    trust: Trusted = False,
) -> None:
    """Draw the scene of a recording at one moment, with its soft bodies and markers."""
    from hub.recording.bag_files import default_output

    output = output or default_output(recording, ".png" if modalities is None else ".truth")
    if modalities is None and output.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise typer.BadParameter(f"'{output}' is not a picture: .png or .jpg", param_hint="--output")
    chosen = None if modalities is None else _parse_modalities(modalities)
    scene = _open_scene("render", recording, robot, looks, trust=trust)
    view = camera, (width, height), _parse_point(position, "--from"), _parse_point(target, "--at")
    if chosen is None:
        from PIL import Image

        Image.fromarray(scene.picture(round(time * 1e9), *view)).save(output)
    else:
        from engines.mujoco.truth.recorded_picture import write_truth

        write_truth(scene, output, chosen, round(time * 1e9), round(step * 1e9), *view)
    typer.echo(output)


@film_app.command()
def film(
    recording: Recorded,
    *,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Film to write, .mp4; default: beside the recording."),
    ] = None,
    start: Annotated[
        float, typer.Option(min=0.0, metavar="S", help="Simulated time of the first picture.")
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Simulated time of the last picture.")
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.01, max=1000.0, help="Simulated seconds in a second of the film.")
    ] = 1.0,
    fps: Annotated[int, typer.Option(min=1, max=120, help="Pictures in a second of the film.")] = 25,
    title: Annotated[
        str | None, typer.Option(help="Text in the lower left corner; default: the name of the session.")
    ] = None,
    camera: CameraName = "overview",
    position: Position = None,
    target: Target = None,
    width: Pixels = 800,
    height: Pixels = 600,
    robot: Robot = None,
    looks: LooksName = None,
    trust: Trusted = False,
) -> None:
    """Write a film of a recording, with title and time."""
    from hub.recording.bag_files import default_output

    output = output or default_output(recording, ".mp4")
    if output.suffix.lower() != ".mp4":
        raise typer.BadParameter(f"'{output}' is not a film: .mp4", param_hint="--output")
    if width % 2 or height % 2:
        raise typer.BadParameter("a film has an even width and height", param_hint="--width, --height")
    scene = _open_scene("film", recording, robot, looks, trust=trust, encoder=True)
    from engines.mujoco.pictures.film import Caption, write_film
    from hub.recording.recording import Recording

    opened = Recording(recording)
    last_ns = opened.duration_ns if end is None else round(end * 1e9)
    times = list(range(round(start * 1e9), last_ns + 1, round(speed * 1e9 / fps)))
    if not times:
        raise typer.BadParameter(f"the recording has {last_ns * 1e-9:g} s", param_hint="--start, --end")
    caption = Caption(opened.scenario().name.replace("_", " ") if title is None else title, height)
    pictures = scene.pictures(
        times,
        camera,
        (width, height),
        _parse_point(position, "--from"),
        _parse_point(target, "--at"),
    )
    frames = (caption.add(picture, at * 1e-9) for at, picture in zip(times, pictures, strict=True))
    with typer.progressbar(frames, length=len(times), label=str(output), file=sys.stderr) as shown:
        write_film(output, shown, (width, height), fps)
    typer.echo(output)


def _open_scene(
    command: str,
    recording: Path,
    robot: str | None,
    looks: Literal["plain", "endoscope"] | None,
    *,
    trust: bool,
    encoder: bool = False,
) -> RecordedScene:
    """Return the scene of a recording. Raises MissingExtraError if a package for the command is missing."""
    needed = {"mujoco": "mujoco", "PIL": "pillow"} | ({"av": "av"} if encoder else {})
    for module, package in needed.items():
        if find_spec(module) is None:
            raise MissingExtraError(f"'trocar {command}'", "film" if encoder else "mujoco", package)
    from engines.mujoco.pictures.recorded_scene import RecordedScene
    from hub.recording.recording import Recording

    return RecordedScene(Recording(recording), robot, looks=looks, trust=trust)


def _parse_modalities(text: str) -> frozenset[Modality]:
    try:
        return parse_modalities(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--modalities") from None


def _parse_point(text: str | None, option: str) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(number) for number in text.replace(",", " ").split())
    except ValueError:
        raise typer.BadParameter(
            f"'{text}' is not a point; write x,y,z in metres", param_hint=option
        ) from None
    return x, y, z
