"""`trocar link`: what lies between a device and the hub of a running session."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import ValidationError

from hub.command_line.display import console, show
from hub.command_line.scenarios import Json
from schemas.network_link import PRESETS

__all__ = ["link"]

_PRESETS = ", ".join(f"{ns // 10**6} ms" for ns in PRESETS)


def link(
    device: Annotated[str, typer.Argument(metavar="DEVICE", help="A device of a running session.")],
    *,
    preset: Annotated[
        str | None,
        typer.Option(
            metavar="DURATION", help=f"A delay in each direction that stands for something: {_PRESETS}."
        ),
    ] = None,
    delay: Annotated[
        str | None,
        typer.Option(
            metavar="DURATION", help="Any other shortest time on the way, such as '35 ms', in each direction."
        ),
    ] = None,
    jitter: Annotated[
        str | None, typer.Option(metavar="DURATION", help="Each message takes up to this much longer.")
    ] = None,
    loss: Annotated[float | None, typer.Option(help="Share of the messages that get lost.")] = None,
    outage: Annotated[
        str | None,
        typer.Option(metavar="DURATION", help="Let nothing through for so long from now on, such as '3 s'."),
    ] = None,
    session: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Of which session; by default the one that has such a device."),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="Where a hub listens; by default all of this machine's are asked."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Put delay, jitter, loss or an outage between a device and the hub while a session runs; what is not
    said stays as it is.
    """
    from hub.devices.network_link_control import NetworkLinkReply, NetworkLinkRequest
    from hub.remote.live_sessions import ask_about
    from hub.transport.endpoints import listening_endpoints

    said = {"preset": preset, "delay": delay, "jitter": jitter, "loss": loss, "outage": outage}
    try:
        request = NetworkLinkRequest.model_validate(
            {"device": device} | {key: value for key, value in said.items() if value is not None}
        )
    except ValidationError as error:
        wrong = error.errors()[0]
        raise typer.BadParameter(
            wrong["msg"].removeprefix("Value error, "), param_hint=f"--{wrong['loc'][0]}"
        ) from error
    reply = ask_about(
        device, connect or listening_endpoints(), "link", request, NetworkLinkReply, session=session
    )
    if as_json:
        show(reply.model_dump(mode="json"), as_json=True)
    else:
        console.print(f"between '{reply.device}' and the hub from now on: {reply.description or 'nothing'}")
