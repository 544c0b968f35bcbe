"""The sessions that are running now, as their hubs tell."""

from __future__ import annotations

from collections.abc import Iterable

import zenoh

from hub.wire import open_session
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.trocar_msgs import SessionStatus

__all__ = ["live_sessions"]

ANSWER_S = 2.0
"""A hub answers within a step; a paused one at once."""


def live_sessions(endpoints: Iterable[str]) -> list[SessionStatus]:
    """Return the status of every session whose hub listens on one of `endpoints`; whoever else listens there is passed over."""
    found: dict[str, SessionStatus] = {}
    for endpoint in endpoints:
        try:
            with open_session("client", connect=[endpoint]) as session:
                replies = session.get(Keys("*").status, timeout=ANSWER_S)
                for reply in replies:
                    if reply.ok is not None:
                        status = decode(SessionStatus, reply.ok.payload.to_bytes())
                        found[status.session] = status
        except (ConnectError, MessageError, zenoh.ZError):
            continue
    return [found[name] for name in sorted(found)]
