"""The commands `trocar stitch`: pick a stitch in a running session, consent, pause and resume."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from hub.command_line.display import console
from hub.command_line.options import HubEndpoints

__all__ = ["app"]

app = typer.Typer(help="Guide a stitch of a running session.", no_args_is_help=True)

Lead = Annotated[str, typer.Option(metavar="NAME", help="The participant `guided-stitching`.")]
Session = Annotated[
    str | None, typer.Option(metavar="NAME", help="The session; needed if several have such a participant.")
]
Place = Annotated[tuple[float, float, float], typer.Option(metavar="X Y Z", help="In mm, in the frame.")]

Pixel = Annotated[tuple[float, float], typer.Option(metavar="X Y", help="In pixels, right and down.")]


@app.command()
def pick(
    *,
    entry: Place,
    exit_: Annotated[
        tuple[float, float, float], typer.Option("--exit", metavar="X Y Z", help="In mm, in the frame.")
    ],
    frame: Annotated[
        str, typer.Option(help="A frame of the scene: world, a fixture, <arm>_base, <arm>, ...")
    ] = "world",
    lead: Lead = "lead",
    session: Session = None,
    connect: HubEndpoints = None,
) -> None:
    """Pick where the needle goes in, and where it comes out; the path is shown, or why there is none."""
    for place in (entry, exit_):
        x, y, z = (each * 1e-3 for each in place)
        point = {"header": {"frame_id": frame}, "point": {"x": x, "y": y, "z": z}}
        _set(lead, "pick", point, session, connect)
    console.print("picked; what follows is on the participant's `status` and in the picture")


@app.command()
def click(
    *,
    entry: Pixel,
    exit_: Annotated[
        tuple[float, float], typer.Option("--exit", metavar="X Y", help="In pixels, right and down.")
    ],
    eye: Annotated[str, typer.Option(help="Whose picture: left or right.")] = "left",
    camera: Annotated[str, typer.Option(metavar="NAME", help="The endoscope.")] = "endoscope",
    lead: Lead = "lead",
    session: Session = None,
    connect: HubEndpoints = None,
) -> None:
    """Pick entry and exit by what is seen: the points of the pad under two pixels of a picture."""
    for x, y in (entry, exit_):
        point = {"header": {"frame_id": f"{camera}_{eye}_image"}, "point": {"x": x, "y": y, "z": 0.0}}
        _set(lead, "pick", point, session, connect)
    console.print("picked; what follows is on the participant's `status` and in the picture")


@app.command()
def say(
    word: Annotated[str, typer.Argument(help="consent, pause, resume, 'take over' or cancel")],
    *,
    lead: Lead = "lead",
    session: Session = None,
    connect: HubEndpoints = None,
) -> None:
    """Consent to the path that is shown; pause, resume, take over or cancel."""
    from controllers.stitching.stage import COMMANDS

    if word not in COMMANDS:
        raise typer.BadParameter(f"'{word}' is no command, allowed: {', '.join(COMMANDS)}")
    _set(lead, "command", {"data": word}, session, connect)


def _set(lead: str, port: str, value: dict[str, Any], session: str | None, connect: list[str] | None) -> None:
    from hub.remote.live_sessions import ask_about
    from hub.transport.control_messages import Empty, SetRequest
    from hub.transport.hub_files import running_hubs

    endpoints = connect or [hub.endpoint for hub in running_hubs()]
    request = SetRequest(participant=lead, port=f"operator/{port}", value=value)
    ask_about(lead, endpoints, "set", request, Empty, session=session)
