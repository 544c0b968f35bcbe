"""The commands `trocar ros` (running gateways, clients and rates) and `trocar ros bag`."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from hub.command_line.display import show, table
from hub.command_line.options import Json, RecordingPath, Trust
from schemas.trocar_msgs import GatewayStatus

__all__ = ["app"]

_DIRECTIONS = {"publish": "published", "subscribe": "received", "serve": "answered"}

app = typer.Typer()


@app.callback(invoke_without_command=True)
def ros(
    context: typer.Context,
    *,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT", help="Where a hub of this machine listens; by default all are asked."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show the gateways to ROS of all sessions: connected programs, and the rates of all topics."""
    if context.invoked_subcommand is not None:
        return
    from devices.ros.running_gateways import running_gateways
    from hub.transport.hub_files import running_hubs

    gateways = running_gateways(connect or [hub.endpoint for hub in running_hubs()])
    if as_json:
        typer.echo(
            json.dumps(
                [
                    {"session": session, "gateway": name, "place": place} | status.model_dump()
                    for (session, name), (status, place) in gateways.items()
                ],
                indent=2,
            )
        )
        return
    out = Console(highlight=False)
    if not gateways:
        out.print(
            "no gateway to ROS is running; a scenario has one with `kind: ros2-zenoh`: trocar run ros",
            soft_wrap=True,
        )
    for (session, name), (status, place) in gateways.items():
        where = f"session '{session}'{f' at {place}' if place else ''}"
        _print(out, where, name, status)


@app.command()
def bag(
    recording: RecordingPath,
    *,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The directory to write; by default <recording>-ros beside it."),
    ] = None,
    gateway: Annotated[
        str | None, typer.Option(help="Whose topics, where a session has several gateways.")
    ] = None,
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Write the ROS messages of a recorded session as a bag, for `ros2 bag play`."""
    from devices.ros.bags.export import export
    from hub.recording.recording import Recording

    stem = recording.parent if recording.is_file() else recording
    target = output or stem.with_name(f"{stem.resolve().name}-ros")
    show(asdict(export(Recording(recording), target, gateway, trust=trust)), as_json=as_json)


def _print(out: Console, where: str, name: str, status: GatewayStatus) -> None:
    clients = ", ".join(
        f"{client.name}{f' ({client.address})' if client.address else ''}" for client in status.clients
    )
    out.print(
        f"[bold]{name}[/] ({status.kind}) in {escape(where)}, connected: {escape(clients) or 'none'}",
        soft_wrap=True,
    )
    shown = table(
        _rows(status), "topic", "direction", "per second", "messages", "refused", "why the last one"
    )
    # names are shown in full: half a name cannot be read
    shown.columns[0].min_width = max((len(topic.topic) for topic in status.topics), default=0)
    out.print(shown)


def _rows(status: GatewayStatus) -> Iterable[tuple[Any, ...]]:
    for topic in sorted(status.topics, key=lambda topic: topic.topic):
        yield (
            topic.topic,
            _DIRECTIONS[topic.way],
            f"{topic.rate:.1f}",
            topic.messages,
            topic.refused or "",
            topic.reason,
        )
