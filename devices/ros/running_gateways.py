"""Running gateways of the sessions of this machine, from their status (once a second)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import partial
from threading import Lock
from time import sleep
from typing import NamedTuple

import zenoh
from zenoh.handlers import Callback

from hub.transport.session_secret import secret_of
from hub.transport.zenoh_session import open_session
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import PLACE, Keys
from schemas.ros import StringMessage
from schemas.trocar_msgs import GatewayStatus

__all__ = ["RunningGateway", "running_gateways"]

_WAIT_S = 1.5
"""Wait for the status of a gateway, published once a second."""


class RunningGateway(NamedTuple):
    """A gateway as it reports itself."""

    status: GatewayStatus
    place: str
    """Where programs reach it; empty: not known yet."""


def running_gateways(endpoints: Iterable[str]) -> Mapping[tuple[str, str], RunningGateway]:
    """Return every gateway, by session and name, of the hubs listening on `endpoints`.

    A gateway over Zenoh is reached at its hub. Endpoints of other programs are passed over.
    """
    found: dict[tuple[str, str], GatewayStatus] = {}
    places: dict[tuple[str, str], str] = {}
    hubs: dict[tuple[str, str], str] = {}
    lock = Lock()

    def receive(hub: str, sample: zenoh.Sample) -> None:
        _, session, _, name, _, port, *_ = str(sample.key_expr).split("/")
        payload = sample.payload.to_bytes()
        with suppress(MessageError), lock:
            hubs[session, name] = hub
            if port == PLACE:
                places[session, name] = decode(StringMessage, payload).data
            else:
                found[session, name] = decode(GatewayStatus, payload)

    clients: list[zenoh.Session] = []
    for endpoint in endpoints:
        with suppress(ConnectError, zenoh.ZError):
            client = open_session("client", connect=[endpoint], security=secret_of(endpoint))
            for port in ("gateway", PLACE):
                told = Callback(partial(receive, endpoint), indirect=True)
                client.declare_subscriber(Keys("*").output("device", "*", port), told)
            clients.append(client)
    if clients:
        sleep(_WAIT_S)
    for client in clients:
        client.close()
    with lock:
        result: dict[tuple[str, str], RunningGateway] = {}
        for key, status in sorted(found.items()):
            at = (hubs[key],) if status.kind == "ros2-zenoh" else ()
            place = (places[key],) if key in places else ()
            result[key] = RunningGateway(status, ", ".join((*at, *place)))
        return result
