"""Where a hub listens on this machine, and where to look for hubs."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from contextlib import suppress
from ipaddress import ip_address

from schemas.errors import ConnectError, ScenarioError

__all__ = ["PORTS", "free_endpoint", "listening_endpoints", "require_loopback"]

PORTS = range(7447, 7467)
"""Zenoh's own port, and the next ones for further hubs on the same machine."""


def free_endpoint(ports: Iterable[int] = PORTS) -> str:
    """Return the endpoint of the first loopback port that is free. Port 0 is any free one. Raises ConnectError if none is."""
    for port in ports:
        try:
            with socket.create_server(("127.0.0.1", port)) as probe:
                return _endpoint(probe.getsockname()[1])
        except OSError:
            continue
    raise ConnectError(
        f"no free port among {PORTS.start} to {PORTS.stop - 1} on 127.0.0.1: end a session that is not needed, or give --listen tcp/127.0.0.1:PORT"
    )


def listening_endpoints() -> list[str]:
    """Return the endpoints of the ports on loopback where somebody listens."""
    found: list[str] = []
    for port in PORTS:
        with socket.socket() as probe:
            probe.settimeout(0.2)
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                found.append(_endpoint(port))
    return found


def require_loopback(endpoint: str) -> str:
    """Return `endpoint` if only this machine can reach it. Raises ScenarioError otherwise: off loopback a hub must not listen without mTLS."""
    protocol, _, address = endpoint.partition("/")
    host = address.rpartition(":")[0].strip("[]")
    if protocol == "tcp":
        with suppress(ValueError):
            if host == "localhost" or ip_address(host).is_loopback:
                return endpoint
    raise ScenarioError(
        f"'{endpoint}' cannot be listened on: a hub listens on loopback only, such as tcp/127.0.0.1:7447. "
        "From another machine, reach it through a tunnel: ssh -L 7447:127.0.0.1:7447 HUB"
    )


def _endpoint(port: int) -> str:
    return f"tcp/127.0.0.1:{port}"
