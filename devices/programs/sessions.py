"""Finding the session that a program leads: on this machine by its name, elsewhere by its endpoint."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from time import monotonic, sleep

import zenoh

from devices.programs.client import Client
from devices.programs.connection import Connection, find_gateway
from devices.ros.zenoh.layout import GraphToken
from hub.remote.hub_connection import reach
from hub.security.credentials import CONSOLE
from hub.transport.endpoints import is_loopback
from hub.transport.hub_files import HubFile, running_hubs
from hub.transport.session_secret import secret_of
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError

__all__ = ["connect"]

_POLL_S = 0.2
_numbers = count(1)


@dataclass(frozen=True)
class _Gateway:
    """A gateway that was found, with the Zenoh session to it."""

    session: zenoh.Session
    label: str
    tokens: list[GraphToken]


def connect(
    session: str = "",
    *,
    endpoint: str = "",
    certificates: Path | None = None,
    domain: int = 0,
    timeout_s: float = 10.0,
) -> Client:
    """Connect this program to a running session, whose arms it may then lead; the session goes on after it.

    Args:
        session: name of a session of this user on this machine; empty: the only one there is.
        endpoint: where the hub listens, such as tls/hub.lab:7447, for a session on another machine; this
            machine then needs the certificate `console` (`trocar certs issue console`).
        certificates: directory or file of the certificate; by default this user's directory.
        domain: `domain` of the gateway in the scenario.
        timeout_s: longest wait for the session to start.

    Raises ConnectError if there is no such session, several, or a session without a gateway to programs.
    """
    deadline = monotonic() + timeout_s
    find = _remote(endpoint, certificates, domain) if endpoint else lambda: _local(session, domain)
    while True:
        gateways = find()
        if len(gateways) == 1:
            gateway = gateways[0]
            node = f"/python_{os.getpid()}_{next(_numbers)}"
            return Client(Connection(gateway.session, gateway.label, node, domain, gateway.tokens))
        for gateway in gateways:
            gateway.session.close()
        if gateways:
            labels = ", ".join(gateway.label for gateway in gateways)
            raise ConnectError(
                f"several sessions may be led by programs: {labels}. Name one: connect('NAME')"
            )
        if monotonic() > deadline:
            raise ConnectError(_absence(session, endpoint))
        sleep(_POLL_S)


def _local(name: str, domain: int) -> list[_Gateway]:
    """Return the gateways of this user's sessions on this machine."""
    found: list[_Gateway] = []
    for hub in running_hubs():
        if name in ("", hub.session):
            with suppress(ConnectError):  # the session has just ended, or is about to listen
                found += _gateways(_open(hub), f"session '{hub.session}'", domain)
    return found


def _open(hub: HubFile) -> zenoh.Session:
    if hub.programs:
        return open_session("client", connect=[hub.programs])
    return open_session("client", connect=[hub.endpoint], security=secret_of(hub.endpoint))


def _remote(endpoint: str, certificates: Path | None, domain: int) -> Callable[[], list[_Gateway]]:
    open_to_all = is_loopback(endpoint) and any(hub.programs == endpoint for hub in running_hubs())

    def find() -> list[_Gateway]:
        session = (
            open_session("client", connect=[endpoint])
            if open_to_all
            else reach(endpoint, CONSOLE, certificates)
        )
        return _gateways(session, f"the session at {endpoint}", domain)

    return find


def _gateways(session: zenoh.Session, label: str, domain: int) -> list[_Gateway]:
    """Return the gateway at the router of `session`; close `session` if there is none."""
    tokens = [its for its in find_gateway(session, domain).values() if len(its) > 1]
    if not tokens:
        session.close()
        return []
    return [_Gateway(session, label, tokens[0])]


def _absence(name: str, endpoint: str) -> str:
    """Return why there is no gateway, and what to do."""
    remedy = (
        "To be led by programs, a scenario has `programs: {kind: programs}` among its participants, and the"
        " connections `programs.* -> motion.*` and `motion.* -> programs.*`; `trocar run psm` has them"
    )
    if endpoint:
        return f"the session at {endpoint} has no arm for programs. {remedy}"
    running = [hub.session for hub in running_hubs()]
    if name and name not in running:
        others = f"; running are: {', '.join(running)}" if running else ""
        return f"no session '{name}' of this user runs on this machine{others}. Start one: trocar run {name}"
    if not running:
        return "no session of this user runs on this machine. Start one: trocar run psm"
    return f"no arm of the running session {', '.join(map(repr, running))} is for programs. {remedy}"
