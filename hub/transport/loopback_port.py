"""The port on loopback where a hub listens."""

from __future__ import annotations

import socket
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from weakref import finalize

import zenoh

from hub.transport.endpoints import PORTS, address, require_loopback
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError, ScenarioError

__all__ = ["LoopbackPort", "listening_ports"]

_TRIES = 5
"""Number of free ports tried: another process may bind a port just before the hub listens."""


class LoopbackPort:
    """A given port, or a free port reserved until the hub listens there.

    Of hubs started in the same moment each holds a port of its own, by a socket bound to the port.
    """

    def __init__(self, endpoint: str | None = None, ports: Sequence[int] = (*PORTS, 0)) -> None:
        """Hold a free port if `endpoint` is None or names port 0 (any free port).

        Args:
            endpoint: such as tcp/127.0.0.1:7447.
            ports: candidates if no endpoint is given, the first free port wins; 0 for any free port.

        Raises ScenarioError if `endpoint` is not on loopback, ConnectError if no port is free.
        """
        self._range = ports
        self._ports: Sequence[int] = ports
        self._held: socket.socket | None = None
        self.endpoint = "" if endpoint is None else require_loopback(endpoint)
        """Endpoint of the hub; unless given, the port may change in `listen`."""
        if endpoint is not None:
            port = address(endpoint)[1]
            self._ports = (0,) if port == 0 else ()
        if self._ports:
            self._hold()

    @property
    def given(self) -> bool:
        """Whether the port was given, not chosen."""
        return not self._ports

    def another(self) -> LoopbackPort:
        """Return another free port, chosen in the same way."""
        return LoopbackPort(ports=self._ports or self._range)

    def listen(
        self,
        *,
        listen: Sequence[str] = (),
        connect: Sequence[str] = (),
        security: Mapping[str, Any] | None = None,
        alone: bool = False,
    ) -> zenoh.Session:
        """Open the Zenoh session of a router on the port, and on the endpoints `listen` too.

        `connect`, `security` and `alone` are parameters of `open_session`. Raises ConnectError if a given
        port is taken.
        """
        tries = _TRIES
        while True:
            self.release()
            try:
                return open_session(
                    "router",
                    listen=[self.endpoint, *listen],
                    connect=connect,
                    security=security,
                    alone=alone,
                )
            except ConnectError:
                tries -= 1
                if not self._ports or not tries:
                    raise
                self._hold()  # a listener or a connection of another process took it in the moment between

    def release(self) -> None:
        """Hold the port no longer."""
        if self._held is not None:
            self._held.close()
            self._held = None

    def _hold(self) -> None:
        for port in self._ports:
            held = _bind_socket(port)
            if held is not None:
                finalize(self, held.close)  # where no hub ever listens
                self._held, self.endpoint = held, f"tcp/127.0.0.1:{held.getsockname()[1]}"
                return
        raise ConnectError(
            f"no free port among {self._ports[0]} to {self._ports[-1]} on 127.0.0.1: end a session that is"
            " not needed, or give --listen tcp/127.0.0.1:PORT"
        )


def listening_ports(endpoints: Iterable[str]) -> tuple[LoopbackPort, list[str]]:
    """Return the loopback port of a hub, and the endpoints of the hub's gate for remote machines.

    If `endpoints` has no loopback endpoint, a free port is chosen. Raises ScenarioError if an endpoint is
    neither TCP on loopback nor TLS.
    """
    given = list(endpoints)
    outside = [endpoint for endpoint in given if endpoint.startswith("tls/")]
    inside = [require_loopback(endpoint) for endpoint in given if endpoint not in outside]
    if len(inside) > 1:
        raise ScenarioError(f"{', '.join(inside)}: a hub listens once on loopback")
    taken = {address(endpoint)[1] for endpoint in outside}
    free = [*(port for port in PORTS if port not in taken), 0]
    return LoopbackPort(inside[0] if inside else None, free), outside


def _bind_socket(port: int) -> socket.socket | None:
    """Return a socket bound to `port`; None if the port is taken."""
    held = socket.socket()
    try:
        held.bind(("127.0.0.1", port))
    except OSError:
        held.close()
        return None
    return held
