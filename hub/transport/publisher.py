"""A publisher on Zenoh that knows whether anybody listens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.handlers import Callback

__all__ = ["Publisher"]


class Publisher:
    """Publishes under one key, at once and before all else; tells when the first listener comes and the last
    one goes.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        choked: zenoh.CongestionControl,
        changed: Callable[[], None],
        *,
        always: bool,
    ) -> None:
        """`choked`: what becomes of a message that cannot go now; `changed` is called whenever `wanted` may
        be another; `always`: it is wanted anyhow.
        """
        self._publisher = session.declare_publisher(
            key,
            encoding=zenoh.Encoding.APPLICATION_CDR,
            congestion_control=choked,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self.wanted = always
        """Whether somebody listens."""
        self._changed = changed
        if not always:
            self._listener = self._publisher.declare_matching_listener(Callback(self._match, indirect=False))
            self._match(self._publisher.matching_status)

    def _match(self, status: Any) -> None:
        self.wanted = bool(status.matching)
        self._changed()

    def put(self, payload: bytes, tag: bytes) -> None:
        """Publish a message with what goes along with it."""
        self._publisher.put(payload, attachment=tag)

    def close(self) -> None:
        """Publish no more."""
        self._publisher.undeclare()
