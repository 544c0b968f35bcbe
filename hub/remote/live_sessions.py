"""Queries to running sessions."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from time import sleep
from typing import TypeVar

import zenoh
from pydantic import BaseModel
from zenoh.handlers import Callback

from hub.remote.hub_connection import is_listening, reach
from hub.security.credentials import OBSERVER
from hub.transport.control_client import ask
from hub.transport.endpoints import is_loopback
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import PLACE, Keys
from schemas.message import Message
from schemas.ros import StringMessage
from schemas.trocar_msgs import Profile, SessionStatus

__all__ = ["ask_about", "live_places", "live_profiles", "live_sessions", "session_of"]

R = TypeVar("R", bound=BaseModel)
M = TypeVar("M", bound=Message)

_NO_HUB = ConnectError, MessageError, zenoh.ZError
"""The errors of a query to a server other than a hub."""

_PLACES_S = 1.5
"""Wait for the place of a gateway."""

ANSWER_S = 2.0
"""Time for an answer: a hub answers within a step, a paused hub at once."""


def live_sessions(endpoints: Iterable[str], certificates: Path | None = None) -> list[SessionStatus]:
    """Return the status of every session with a hub at one of `endpoints`.

    A hub on another machine needs the certificate `observer`, read from `certificates`; raises ConnectError
    if there is no such hub. On this machine, endpoints without a hub are ignored.
    """
    statuses = _query_sessions(endpoints, certificates, Keys("*").status, SessionStatus)
    found = {status.session: status for status in statuses}
    return [found[name] for name in sorted(found)]


def live_profiles(endpoints: Iterable[str], certificates: Path | None = None) -> dict[int, Profile]:
    """Return the profile of each session that has a profile, keyed by run number.

    Arguments and errors are the same as for `live_sessions`.
    """
    profiles = _query_sessions(endpoints, certificates, Keys("*").profile, Profile)
    return {profile.run: profile for profile in profiles}


def live_places(endpoints: Iterable[str], certificates: Path | None = None) -> Mapping[tuple[str, str], str]:
    """Return where programs reach gateways, by session and participant: master, domain or endpoint.

    Arguments and errors are the same as for `live_sessions`.
    """
    found: dict[tuple[str, str], str] = {}

    def receive(sample: zenoh.Sample) -> None:
        _, session, _, name, *_ = str(sample.key_expr).split("/")
        with suppress(MessageError):
            found[session, name] = decode(StringMessage, sample.payload.to_bytes()).data

    with ExitStack() as clients:
        for endpoint in endpoints:
            with suppress(*_NO_HUB) if is_loopback(endpoint) else nullcontext():
                client = clients.enter_context(reach(endpoint, OBSERVER, certificates))
                client.declare_subscriber(
                    Keys("*").output("device", "*", PLACE), Callback(receive, indirect=True)
                )
        sleep(_PLACES_S)
    return dict(sorted(found.items()))


def _query_sessions(endpoints: Iterable[str], certificates: Path | None, key: str, model: type[M]) -> list[M]:
    """Return the answers of the sessions at `endpoints` on `key`."""
    found: list[M] = []
    for endpoint in endpoints:
        if is_loopback(endpoint) and not is_listening(
            endpoint
        ):  # a hub that is about to start has no session yet
            continue
        with (
            suppress(*_NO_HUB) if is_loopback(endpoint) else nullcontext(),
            reach(endpoint, OBSERVER, certificates) as session,
        ):
            found += _ask(session, key, model)
    return found


def ask_about(
    participant: str,
    endpoints: Iterable[str],
    verb: str,
    request: BaseModel,
    reply_model: type[R],
    *,
    session: str | None = None,
) -> R:
    """Send a request to the hub of the session with `participant`, and return the reply.

    Args:
        participant: A participant of the session.
        endpoints: Where hubs listen.
        verb: The kind of request, as in the key.
        request: The request.
        reply_model: The model of the reply.
        session: The name of the session, needed if several have such a participant.

    Raises:
        ConnectError: There is no such session on these endpoints, or more than one.
        MessageError: The hub rejects the request.
    """
    with session_of(participant, endpoints, session) as (client, keys):
        return ask(client, keys.control(verb), request, reply_model)


@contextmanager
def session_of(
    participant: str, endpoints: Iterable[str], session: str | None = None
) -> Generator[tuple[zenoh.Session, Keys]]:
    """Yield a connection to the session with `participant`, and its keys; raises like `ask_about`."""
    seen: list[str] = []
    found: list[tuple[zenoh.Session, str]] = []
    with ExitStack() as clients:
        for endpoint in endpoints:
            client = _hub_at(endpoint)
            if client is None:
                continue
            clients.enter_context(client)
            for status in _statuses(client):
                seen.append(status.session)
                if session in (None, status.session) and any(
                    p.name == participant for p in status.participants
                ):
                    found.append((client, status.session))
        if len(found) > 1:
            raise ConnectError(
                f"several sessions have a '{participant}': {', '.join(sorted(name for _, name in found))};"
                " choose one by --session, or by --connect where the names are the same"
            )
        for client, name in found:
            yield client, Keys(name)
            return
    where = f"session '{session}'" if session else "any session"
    raise ConnectError(
        f"there is no '{participant}' in {where} of these hubs; running: {', '.join(sorted(seen)) or 'none'}"
    )


def _hub_at(endpoint: str) -> zenoh.Session | None:
    """Return a session with the hub at `endpoint`; None if the server there on this machine is no hub."""
    try:
        return reach(endpoint, OBSERVER)
    except ConnectError:
        if is_loopback(endpoint):
            return None
        raise


def _statuses(session: zenoh.Session) -> Iterator[SessionStatus]:
    return _ask(session, Keys("*").status, SessionStatus)


def _ask(session: zenoh.Session, key: str, model: type[M]) -> Iterator[M]:
    for reply in session.get(key, timeout=ANSWER_S):
        if reply.ok is not None:
            yield decode(model, reply.ok.payload.to_bytes())
