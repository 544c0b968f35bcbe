"""The commands `trocar stitch`: pick a stitch in a running session, consent, pause and resume."""

from __future__ import annotations

from collections.abc import Sequence
from queue import Empty as NothingSaid
from queue import SimpleQueue
from threading import Event
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hub.command_line.display import console
from hub.command_line.options import HubEndpoints
from schemas.codec import decode
from schemas.errors import ConnectError, MotionError
from schemas.ros import StringMessage

if TYPE_CHECKING:
    import zenoh

__all__ = ["app"]

_PATIENCE_S = 5.0

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
    """Pick entry and exit of the needle; the path is shown, or why there is none."""
    points = [[each * 1e-3 for each in place] for place in (entry, exit_)]
    _tell(lead, [("pick", _point_stamped(frame, *point)) for point in points], session, connect)


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
    """Pick entry and exit in the picture: the points of the pad under two pixels."""
    frame = f"{camera}_{eye}_image"
    _tell(lead, [("pick", _point_stamped(frame, x, y, 0.0)) for x, y in (entry, exit_)], session, connect)


@app.command()
def say(
    words: Annotated[
        list[str],
        typer.Argument(help="consent NAME, with the name of the proposal; pause, resume, take over, cancel"),
    ],
    *,
    lead: Lead = "lead",
    session: Session = None,
    connect: HubEndpoints = None,
) -> None:
    """Consent to the path shown; pause, resume, take over or cancel."""
    from controllers.stitching.stage import COMMANDS

    text = " ".join(words)
    if text not in COMMANDS and not text.startswith("consent "):
        raise typer.BadParameter(f"'{text}' is no command, allowed: {', '.join(COMMANDS)}")
    _tell(lead, [("command", {"data": text})], session, connect)


def _point_stamped(frame: str, x: float, y: float, z: float) -> dict[str, Any]:
    return {"header": {"frame_id": frame}, "point": {"x": x, "y": y, "z": z}}


def _tell(
    lead: str, values: Sequence[tuple[str, dict[str, Any]]], session: str | None, connect: list[str] | None
) -> None:
    """Write values to a person's ports, each after the previous answer, and print the answers.

    Raises MotionError if a value is refused, ConnectError if there is no answer.
    """
    from zenoh.handlers import Callback

    from hub.remote.live_sessions import session_of
    from hub.transport.control_client import ask
    from hub.transport.control_messages import Empty, SetRequest
    from hub.transport.hub_files import running_hubs

    endpoints = connect or [hub.endpoint for hub in running_hubs()]
    said: SimpleQueue[str] = SimpleQueue()
    runs = Event()

    def hear(sample: zenoh.Sample) -> None:
        said.put(decode(StringMessage, sample.payload.to_bytes()).data)

    def see(_sample: zenoh.Sample) -> None:
        runs.set()

    with session_of(lead, endpoints, session) as (client, keys):
        client.declare_subscriber(keys.view(lead, "status"), Callback(hear, indirect=False))
        client.declare_subscriber(keys.view(lead, "stage"), Callback(see, indirect=False))
        heard = runs.wait(_PATIENCE_S)  # with the first stage it is known that the session publishes for us
        for port, value in values:
            request = SetRequest(participant=lead, port=f"operator/{port}", value=value)
            ask(client, keys.control("set"), request, Empty)
            try:
                answer = said.get(timeout=_PATIENCE_S if heard else 0.0)
            except NothingSaid:
                raise ConnectError(f"'{lead}' has not answered: the session may be paused") from None
            if answer.startswith("refused: "):
                raise MotionError(answer.removeprefix("refused: "))
            console.print(answer, markup=False, highlight=False)
