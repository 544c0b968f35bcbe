"""Files with the endpoints of this user's hubs on this machine: a file for each running hub.

With these files `trocar ls` finds hubs at any port. The file of a killed hub stays until the next look finds
no process listening there.
"""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass

from hub.transport.endpoints import address
from hub.transport.session_secret import private_directory
from schemas.errors import ConnectError

__all__ = ["HubFile", "hub_file", "only_hub", "running_hubs"]

_PROBE_S = 1.0


@dataclass(frozen=True)
class HubFile:
    """Content of the file of a hub."""

    endpoint: str
    """Where the hub listens on loopback."""
    outside: tuple[str, ...]
    """Endpoints of the gate for remote machines."""
    pid: int
    session: str = ""
    programs: str = ""
    """Where programs connect, with the secret of the session if at `endpoint`; empty: nowhere."""


@contextmanager
def hub_file(
    endpoint: str, outside: Sequence[str], *, session: str = "", programs: str = ""
) -> Generator[None]:
    """Keep the file of a hub of this process, listening at `endpoint` and at `outside`.

    `session`, `programs`: as in `HubFile`.
    """
    content = HubFile(endpoint, tuple(outside), os.getpid(), session, programs)
    file = private_directory() / f"{address(endpoint)[1]}.json"
    file.write_text(json.dumps(asdict(content)), encoding="utf-8")
    try:
        yield
    finally:
        file.unlink(missing_ok=True)


def running_hubs() -> list[HubFile]:
    """Return the contents of the hub files with a process listening at the endpoint; delete the rest."""
    found: list[HubFile] = []
    for file in sorted(private_directory().glob("*.json")):
        try:
            said = json.loads(file.read_text(encoding="utf-8"))
            hub = HubFile(**said | {"outside": tuple(said["outside"])})
        except (OSError, ValueError, KeyError, TypeError):  # being written, or just deleted, or not ours
            continue
        try:
            socket.create_connection(address(hub.endpoint), _PROBE_S).close()
        except ConnectionRefusedError:
            file.unlink(missing_ok=True)
            continue
        except (TimeoutError, ConnectionResetError):  # it listens, and is busy, stopped, or about to end
            pass
        found.append(hub)
    return found


def only_hub() -> str:
    """Return where the only hub of this user listens on loopback.

    Raises ConnectError if none runs on this machine, or several do.
    """
    hubs = running_hubs()
    if not hubs:
        raise ConnectError(
            "no hub of this user runs on this machine: start the session first, or say where it is with"
            " --connect"
        )
    if len(hubs) > 1:
        endpoints = ", ".join(hub.endpoint for hub in hubs)
        raise ConnectError(f"{len(hubs)} hubs run on this machine: choose one with --connect: {endpoints}")
    return hubs[0].endpoint
