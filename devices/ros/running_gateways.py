"""Running gateways of the sessions of this machine, from their status (once a second)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from threading import Lock
from time import sleep

import zenoh
from zenoh.handlers import Callback

from hub.transport.session_secret import secret_of
from hub.transport.zenoh_session import open_session
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.trocar_msgs import GatewayStatus

__all__ = ["running_gateways"]

_WAIT_S = 1.5
"""Wait for the status of a gateway, published once a second."""


def running_gateways(endpoints: Iterable[str]) -> Mapping[tuple[str, str], GatewayStatus]:
    """Return the status of every gateway, by session and name, of the hubs listening on `endpoints`.

    Endpoints of other programs are passed over.
    """
    found: dict[tuple[str, str], GatewayStatus] = {}
    lock = Lock()

    def receive(sample: zenoh.Sample) -> None:
        _, session, _, name, *_ = str(sample.key_expr).split("/")
        with suppress(MessageError), lock:
            found[session, name] = decode(GatewayStatus, sample.payload.to_bytes())

    clients: list[zenoh.Session] = []
    for endpoint in endpoints:
        with suppress(ConnectError, zenoh.ZError):
            client = open_session("client", connect=[endpoint], security=secret_of(endpoint))
            client.declare_subscriber(
                Keys("*").output("device", "*", "gateway"), Callback(receive, indirect=True)
            )
            clients.append(client)
    if clients:
        sleep(_WAIT_S)
    for client in clients:
        client.close()
    with lock:
        return dict(sorted(found.items()))
