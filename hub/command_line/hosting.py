"""`trocar engine` and `trocar device`: host one participant of a session whose hub is elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["Certificates", "device", "engine"]

Participant = Annotated[
    str, typer.Argument(metavar="NAME", help="A participant that the scenario places with `host: remote`.")
]
Connect = Annotated[
    str,
    typer.Option(
        metavar="ENDPOINT",
        help="Where the hub listens: tls/HUB:7447, or on its own machine tcp/127.0.0.1:7447.",
    ),
]
SessionName = Annotated[
    str,
    typer.Option(
        "--session", metavar="NAME", help="The session to join; by default the one that the hub has."
    ),
]
Directory = Annotated[
    Path | None,
    typer.Option(exists=True, file_okay=False, help="Where relative paths of the scenario start here."),
]
Certificates = Annotated[
    Path | None,
    typer.Option(
        "--certs",
        metavar="PATH",
        exists=True,
        help="The certificate, or the directory where it is; by default this user's own.",
    ),
]


def engine(
    name: Participant,
    *,
    connect: Connect,
    session: SessionName = "*",
    directory: Directory = None,
    certs: Certificates = None,
) -> None:
    """Host one engine or controller of a scenario here, and join a hub elsewhere."""
    from hub.hosting.host_process import run_host

    run_host(connect, session, f"remote/{name}", directory=directory, certificates=certs)


def device(
    name: Participant,
    *,
    connect: Connect,
    session: SessionName = "*",
    directory: Directory = None,
    certs: Certificates = None,
) -> None:
    """Host one device of a scenario here: join a hub elsewhere, wait when it is gone, and join again."""
    from hub.hosting.host_process import run_device

    run_device(connect, session, name, directory=directory, certificates=certs)
