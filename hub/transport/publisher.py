"""A publisher on Zenoh that knows whether it has subscribers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.handlers import Callback

__all__ = ["Publisher"]


class Publisher:
    """Publishes under a key, immediately.

    Args:
        session: The Zenoh session.
        key: The key.
        congestion: Whether a message that cannot be sent now is dropped or waits.
        changed: Is called whenever `needed` may have changed.
        always: Publish without subscribers too.
        priority: A link has a queue for each priority, and a full queue drops messages of its own alone.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        congestion: zenoh.CongestionControl,
        changed: Callable[[], None],
        *,
        always: bool,
        priority: zenoh.Priority = zenoh.Priority.REAL_TIME,
    ) -> None:
        self._publisher = session.declare_publisher(
            key,
            encoding=zenoh.Encoding.APPLICATION_CDR,
            congestion_control=congestion,
            priority=priority,
            express=True,
        )
        self.needed = always
        """Whether there is a subscriber."""
        self._changed = changed
        self._always = always
        if not always:
            self._listener = self._publisher.declare_matching_listener(
                Callback(self._note_match, indirect=False)
            )
            self.look()

    def look(self) -> None:
        """Look for subscribers now: on a busy machine Zenoh tells of a new one some steps late."""
        if not self._always:
            self._note_match(self._publisher.matching_status)

    def _note_match(self, status: Any) -> None:
        self.needed = bool(status.matching)
        self._changed()

    def put(self, payload: bytes, tag: bytes | None = None) -> None:
        """Publish a message with an attachment."""
        self._publisher.put(payload, attachment=tag)

    def close(self) -> None:
        """Publish no more."""
        self._publisher.undeclare()
