"""`trocar link`: the network link between a device and the hub of a running session."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import ValidationError

from hub.command_line.display import results, show
from hub.command_line.options import HubEndpoints, Json
from schemas.network_link import PRESETS

__all__ = ["link"]

_PRESETS = ", ".join(f"{ns // 10**6} ms" for ns in PRESETS)


def link(
    device: Annotated[str, typer.Argument(metavar="DEVICE", help="A device of a running session.")],
    *,
    preset: Annotated[
        str | None,
        typer.Option(metavar="DURATION", help=f"A typical delay in each direction: {_PRESETS}."),
    ] = None,
    delay: Annotated[
        str | None,
        typer.Option(metavar="DURATION", help="Any other delay in each direction, such as '35 ms'."),
    ] = None,
    jitter: Annotated[
        str | None, typer.Option(metavar="DURATION", help="The most that a message may take longer.")
    ] = None,
    loss: Annotated[float | None, typer.Option(help="The share of messages that are lost, below 1.")] = None,
    outage: Annotated[
        str | None,
        typer.Option(metavar="DURATION", help="Block all messages for this time from now on, such as '3 s'."),
    ] = None,
    session: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="The session of the device; needed if several have such a device."),
    ] = None,
    connect: HubEndpoints = None,
    as_json: Json = False,
) -> None:
    """Change the network link of a device in a running session: delay, jitter, loss, outage.

    Missing options keep their values.
    """
    from hub.devices.network_link_control import NetworkLinkReply, NetworkLinkRequest
    from hub.remote.live_sessions import ask_about
    from hub.transport.hub_files import running_hubs

    given = {"preset": preset, "delay": delay, "jitter": jitter, "loss": loss, "outage": outage}
    try:
        request = NetworkLinkRequest.model_validate(
            {"device": device} | {key: value for key, value in given.items() if value is not None}
        )
    except ValidationError as error:
        problem = error.errors()[0]
        message, option = problem["msg"].removeprefix("Value error, "), f"--{problem['loc'][0]}"
        raise typer.BadParameter(message, param_hint=option) from error
    endpoints = connect or [hub.endpoint for hub in running_hubs()]
    reply = ask_about(device, endpoints, "link", request, NetworkLinkReply, session=session)
    if as_json:
        show(reply.model_dump(mode="json"), as_json=True)
    else:
        description = reply.description or "none"
        results.print(f"network link of '{reply.device}' from now on: {description}", soft_wrap=True)
