"""The sessions that are running now, as their hubs tell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TypeVar

import zenoh
from pydantic import BaseModel

from hub.remote.hub_connection import reach
from hub.security.credentials import OBSERVER
from hub.transport.control_client import ask
from hub.transport.endpoints import is_loopback
from hub.transport.zenoh_session import open_session
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.trocar_msgs import SessionStatus

__all__ = ["ask_about", "live_sessions"]

R = TypeVar("R", bound=BaseModel)

_OTHERS = ConnectError, MessageError, zenoh.ZError
"""What comes of asking whoever is no hub."""

ANSWER_S = 2.0
"""A hub answers within a step; a paused one at once."""


def live_sessions(endpoints: Iterable[str], certificates: Path | None = None) -> list[SessionStatus]:
    """Return the status of every session whose hub listens on one of `endpoints`.

    On another machine that needs the certificate `observer`, which is looked for in `certificates`; raises
    ConnectError if there is no hub. On this machine whoever else listens there is passed over.
    """
    found: dict[str, SessionStatus] = {}
    for endpoint in endpoints:
        with (
            suppress(*_OTHERS) if is_loopback(endpoint) else nullcontext(),
            reach(endpoint, OBSERVER, certificates) as session,
        ):
            found |= {status.session: status for status in _statuses(session)}
    return [found[name] for name in sorted(found)]


def ask_about(
    participant: str,
    endpoints: Iterable[str],
    verb: str,
    request: BaseModel,
    reply_model: type[R],
    *,
    session: str | None = None,
) -> R:
    """Ask the hub of the session that has `participant` (and is called `session`, if that is given)
    something.

    Raises ConnectError if there is none on these endpoints, and MessageError if it refuses.
    """
    seen: list[str] = []
    for endpoint in endpoints:
        with open_session("client", connect=[endpoint]) as client:
            for status in _statuses(client):
                seen.append(status.session)
                if session in (None, status.session) and any(
                    p.name == participant for p in status.participants
                ):
                    return ask(client, Keys(status.session).control(verb), request, reply_model)
    where = f"session '{session}'" if session else "any session"
    raise ConnectError(
        f"there is no '{participant}' in {where} that runs here; running: {', '.join(sorted(seen)) or 'none'}"
    )


def _statuses(session: zenoh.Session) -> Iterator[SessionStatus]:
    for reply in session.get(Keys("*").status, timeout=ANSWER_S):
        if reply.ok is not None:
            yield decode(SessionStatus, reply.ok.payload.to_bytes())
