"""The status of a session on Zenoh: published at intervals, and the answer to queries."""

from __future__ import annotations

import zenoh
from zenoh.handlers import Callback

from hub.observation.monitor import Monitor
from hub.session.bookkeeping import Bookkeeping
from hub.session.joined_hosts import JoinedHosts
from hub.transport.run_connection import RunConnection
from schemas.codec import encode

__all__ = ["StatusReporter"]


class StatusReporter:
    """Publishes and records the status on demand, and answers queries for the status at any time."""

    def __init__(
        self,
        run: RunConnection,
        bookkeeping: Bookkeeping,
        joined_hosts: JoinedHosts,
        monitor: Monitor,
    ) -> None:
        self._key, self._monitor = run.keys.status, monitor
        self._bookkeeping, self._joined_hosts = bookkeeping, joined_hosts
        self._publisher = run.session.declare_publisher(self._key, encoding=zenoh.Encoding.APPLICATION_CDR)
        self._queryable = run.session.declare_queryable(self._key, Callback(self._answer))

    def _answer(self, query: zenoh.Query) -> None:
        status = self._bookkeeping.status(self._joined_hosts.pid)
        with query:
            query.reply(self._key, encode(status), encoding=zenoh.Encoding.APPLICATION_CDR)

    def publish(self) -> None:
        """Publish and record the status."""
        status = self._bookkeeping.status(self._joined_hosts.pid)
        self._monitor.status(status)
        self._publisher.put(encode(status))

    def undeclare(self) -> None:
        """Publish and answer no more."""
        self._queryable.undeclare()
        self._publisher.undeclare()
