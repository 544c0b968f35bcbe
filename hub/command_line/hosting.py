"""`trocar engine` and `trocar device`: host one participant of a session whose hub is elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["device", "engine"]

Participant = Annotated[str, typer.Argument(metavar="NAME", help="A participant that the scenario places with `host: remote`.")]
Connect = Annotated[str, typer.Option(metavar="ENDPOINT", help="Where the hub listens, such as tcp/127.0.0.1:7447.")]
SessionName = Annotated[str, typer.Option("--session", metavar="NAME", help="The session to join.")]
Directory = Annotated[Path | None, typer.Option(exists=True, file_okay=False, help="Where relative paths of the scenario start here.")]


def engine(name: Participant, *, connect: Connect, session: SessionName, directory: Directory = None) -> None:
    """Host one engine or controller of a scenario here, and join a hub elsewhere."""
    _host(name, connect, session, directory)


def device(name: Participant, *, connect: Connect, session: SessionName, directory: Directory = None) -> None:
    """Host one device of a scenario here: join a hub elsewhere, wait when it is gone, and join again."""
    from hub.host_process import run_device

    run_device(connect, session, name, directory=directory)


def _host(name: str, endpoint: str, session: str, directory: Path | None) -> None:
    from hub.host_process import run_host

    run_host(endpoint, session, f"remote/{name}", directory=directory)
