"""`trocar engine` and `trocar device`: host a participant of a session with a remote hub."""

from __future__ import annotations

from typing import Annotated

import typer

from hub.command_line.options import Certificates, Directory

__all__ = ["device", "engine"]

Participant = Annotated[
    str, typer.Argument(metavar="NAME", help="A participant with `host: remote` in the scenario.")
]
Connect = Annotated[
    str | None,
    typer.Option(
        metavar="ENDPOINT",
        help="Where the hub listens: tls/HUB:7447, or on this machine tcp/127.0.0.1:7447; default: the only"
        " hub on this machine, which needs no certificates.",
    ),
]
SessionName = Annotated[
    str,
    typer.Option("--session", metavar="NAME", help="The session to join; default: the one of that hub."),
]


def engine(
    name: Participant,
    *,
    connect: Connect = None,
    session: SessionName = "*",
    directory: Directory = None,
    certs: Certificates = None,
) -> None:
    """Host an engine or controller here, for a session with a remote hub."""
    from hub.hosting.joining import run_host
    from hub.transport.hub_files import only_hub

    run_host(connect or only_hub(), session, f"remote/{name}", directory=directory, certificates=certs)


def device(
    name: Participant,
    *,
    connect: Connect = None,
    session: SessionName = "*",
    directory: Directory = None,
    certs: Certificates = None,
) -> None:
    """Host a device here, for sessions with a remote hub.

    The device joins again whenever the hub returns, until stopped.
    """
    from hub.hosting.joining import run_device
    from hub.transport.hub_files import only_hub

    run_device(connect or only_hub(), session, name, directory=directory, certificates=certs)
