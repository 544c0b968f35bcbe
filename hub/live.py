"""The sessions that are running now, as their hubs tell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import TypeVar

import zenoh
from pydantic import BaseModel

from hub.control import ask
from hub.wire import open_session
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.trocar_msgs import SessionStatus

__all__ = ["ask_about", "live_sessions"]

R = TypeVar("R", bound=BaseModel)

ANSWER_S = 2.0
"""A hub answers within a step; a paused one at once."""


def live_sessions(endpoints: Iterable[str]) -> list[SessionStatus]:
    """Return the status of every session whose hub listens on one of `endpoints`; whoever else listens there is passed over."""
    found: dict[str, SessionStatus] = {}
    for endpoint in endpoints:
        with suppress(ConnectError, MessageError, zenoh.ZError), open_session("client", connect=[endpoint]) as session:
            found |= {status.session: status for status in _statuses(session)}
    return [found[name] for name in sorted(found)]


def ask_about(participant: str, endpoints: Iterable[str], verb: str, request: BaseModel, reply_model: type[R], *, session: str | None = None) -> R:
    """Ask the hub of the session that has `participant` (and is called `session`, if that is given) something.

    Raises ConnectError if there is none on these endpoints, and MessageError if it refuses.
    """
    seen: list[str] = []
    for endpoint in endpoints:
        with open_session("client", connect=[endpoint]) as client:
            for status in _statuses(client):
                seen.append(status.session)
                if session in (None, status.session) and any(p.name == participant for p in status.participants):
                    return ask(client, Keys(status.session).control(verb), request, reply_model)
    where = f"session '{session}'" if session else "any session"
    raise ConnectError(f"there is no '{participant}' in {where} that runs here; running: {', '.join(sorted(seen)) or 'none'}")


def _statuses(session: zenoh.Session) -> Iterator[SessionStatus]:
    for reply in session.get(Keys("*").status, timeout=ANSWER_S):
        if reply.ok is not None:
            yield decode(SessionStatus, reply.ok.payload.to_bytes())
