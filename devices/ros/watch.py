"""What the gateways of this machine's sessions tell of themselves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from threading import Lock
from time import sleep

import zenoh
from zenoh.handlers import Callback

from hub.transport.zenoh_session import open_session
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.trocar_msgs import GatewayStatus

__all__ = ["running_gateways"]

_WATCH_S = 1.5
"""Every gateway tells once a second."""


def running_gateways(endpoints: Iterable[str]) -> Mapping[tuple[str, str], GatewayStatus]:
    """Return the status of every gateway, by session and name, of the hubs that listen on `endpoints`;
    whoever else listens there is passed over.
    """
    found: dict[tuple[str, str], GatewayStatus] = {}
    lock = Lock()

    def take(sample: zenoh.Sample) -> None:
        _, session, _, name, *_ = str(sample.key_expr).split("/")
        with suppress(MessageError), lock:
            found[session, name] = decode(GatewayStatus, sample.payload.to_bytes())

    clients: list[zenoh.Session] = []
    for endpoint in endpoints:
        with suppress(ConnectError, zenoh.ZError):
            client = open_session("client", connect=[endpoint])
            client.declare_subscriber(
                Keys("*").output("device", "*", "gateway"), Callback(take, indirect=True)
            )
            clients.append(client)
    if clients:
        sleep(_WATCH_S)
    for client in clients:
        client.close()
    with lock:
        return dict(sorted(found.items()))
