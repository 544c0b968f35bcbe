"""Where a hub listens, and where to look for hubs: on loopback by TCP, elsewhere through a gate by TLS."""

from __future__ import annotations

from contextlib import suppress
from ipaddress import ip_address

from schemas.errors import ScenarioError

__all__ = [
    "PORTS",
    "address",
    "is_loopback",
    "require_loopback",
]

PORTS = range(7447, 7467)
"""Zenoh's own port, and the next ports for further hubs on the same machine, before any free port."""


def require_loopback(endpoint: str) -> str:
    """Return `endpoint` if only this machine can reach the endpoint. Raises ScenarioError otherwise."""
    if is_loopback(endpoint):
        return endpoint
    raise ScenarioError(
        f"'{endpoint}' cannot be listened on: a hub listens on loopback, such as tcp/127.0.0.1:7447, and to"
        " other machines by TLS, such as tls/0.0.0.0:7447"
    )


def is_loopback(endpoint: str) -> bool:
    """Return whether an endpoint is TCP within this machine."""
    if not endpoint.startswith("tcp/"):
        return False
    host, _ = address(endpoint)
    with suppress(ValueError):
        return host == "localhost" or ip_address(host).is_loopback
    return False


def address(endpoint: str) -> tuple[str, int]:
    """Return host and port of an endpoint such as tls/hub.example:7447; raises ScenarioError."""
    _, slash, rest = endpoint.partition("/")
    host, colon, port = rest.rpartition(":")
    if not (slash and colon and host and port.isdecimal()):
        raise ScenarioError(
            f"'{endpoint}' is no endpoint: write tls/HOST:PORT, or tcp/127.0.0.1:PORT on the hub's own"
            " machine"
        )
    return host.strip("[]"), int(port)
