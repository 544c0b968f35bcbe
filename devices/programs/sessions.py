"""Finding a session for a program: on this machine by name, elsewhere by endpoint."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from time import monotonic, sleep

import zenoh

from devices.programs.client import Client
from devices.programs.connection import Connection, find_gateway
from hub.remote.hub_connection import reach
from hub.security.credentials import CONSOLE
from hub.transport.endpoints import is_loopback
from hub.transport.hub_files import HubFile, running_hubs
from hub.transport.session_secret import secret_of
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError
from schemas.keys import same_session_name

__all__ = ["connect"]

_POLL_S = 0.2
_ABSENT_S = 10.0
"""Longest wait for a missing session."""
_numbers = count(1)


_REMEDY = (
    "Start it with: trocar run NAME --programs. In a scenario of your own the participant `programs: {kind:"
    " programs}` and the connections `programs.* -> motion.*` and `motion.* -> programs.*` do the same"
)


def connect(
    session: str = "",
    *,
    endpoint: str = "",
    certificates: Path | None = None,
    domain: int = 0,
    timeout_s: float = 60.0,
) -> Client:
    """Connect this program to a running session, to lead arms; the session outlives the connection.

    Args:
        session: name of a session of this user on this machine; empty: the only session open to programs.
        endpoint: where the hub listens, such as tls/hub.lab:7447, for a session on another machine; this
            machine then needs the certificate `console` (`trocar certs issue console`).
        certificates: directory or file of the certificate; by default this user's directory.
        domain: `domain` of the gateway in the scenario.
        timeout_s: longest wait for the session to start, from its first process on.

    Raises ConnectError for a missing session, a session closed to programs, or several sessions.
    """
    if endpoint:
        open_session_there, label = _at_endpoint(endpoint, certificates), f"the session at {endpoint}"
    else:
        hub = _find_hub(session, min(timeout_s, _ABSENT_S))
        open_session_there, label = partial(_open, hub), f"session '{hub.session}'"
    deadline = monotonic() + timeout_s
    while True:
        there = open_session_there()
        if tokens := find_gateway(there, domain):
            node = f"/python_{os.getpid()}_{next(_numbers)}"
            return Client(Connection(there, label, node, domain, tokens, timeout_s))
        there.close()
        if monotonic() > deadline:
            raise ConnectError(f"{label} has no gateway of domain {domain} within {timeout_s:g} s. {_REMEDY}")
        sleep(_POLL_S)


def _find_hub(name: str, timeout_s: float) -> HubFile:
    """Return the hub of the session `name` of this user on this machine, or of the only session."""
    deadline = monotonic() + timeout_s
    while True:
        hubs = running_hubs()
        named = [hub for hub in hubs if not name or same_session_name(name, hub.session)]
        if len(found := [hub for hub in named if hub.programs]) == 1:
            return found[0]
        if found:
            names = ", ".join(f"'{hub.session}' at {hub.programs}" for hub in found)
            raise ConnectError(
                f"several sessions are open to programs: {names}. State the name or the endpoint:"
                " trocar.connect('NAME'), trocar.connect(endpoint='ENDPOINT')"
            )
        is_late = monotonic() > deadline
        if named and (name or is_late):  # without a name, another session may be about to start
            names = ", ".join(f"'{hub.session}'" for hub in named)
            raise ConnectError(f"session {names} is not open to programs. {_REMEDY}")
        if is_late:
            others = f"; running are: {', '.join(hub.session for hub in hubs)}" if hubs else ""
            what = f"session '{name}'" if name else "session"
            raise ConnectError(
                f"no {what} of this user runs on this machine{others}. Start one: trocar run {name or 'psm'}"
            )
        sleep(_POLL_S)


def _open(hub: HubFile) -> zenoh.Session:
    security = secret_of(hub.endpoint) if hub.programs == hub.endpoint else None
    return open_session("client", connect=[hub.programs], security=security)


def _at_endpoint(endpoint: str, certificates: Path | None) -> Callable[[], zenoh.Session]:
    """Return a function to connect to `endpoint`, on this machine or on another."""
    for hub in running_hubs() if is_loopback(endpoint) else ():
        if hub.programs == endpoint:
            return partial(_open, hub)
    return partial(reach, endpoint, CONSOLE, certificates)
