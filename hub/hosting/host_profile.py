"""The profile of a host process, requested by the hub."""

from __future__ import annotations

from collections.abc import Callable

import zenoh
from zenoh.handlers import Callback

from hub.hosting.host import Host
from hub.hosting.process_profile import WAITING, ProcessProfile
from hub.observation.stopwatch import Phase
from hub.transport.run_connection import RunConnection
from schemas.codec import encode
from schemas.trocar_msgs import Profile

__all__ = ["HostProfile"]


class HostProfile:
    """Answers with the time used by this process since the first grant."""

    def __init__(self, run: RunConnection, host: str) -> None:
        """`run`: the connection of the process; `host`: name of the host."""
        self.process = ProcessProfile(host, run.plan, Phase("waiting for hub", WAITING))
        self.process.restart()
        self._began = False
        self._key, self._session_name, self._run = run.keys.host_profile(host), run.keys.session, run.number
        self._queryable = run.session.declare_queryable(self._key, Callback(self._answer))

    def attach(self, host: Host, acknowledge: Callable[..., None]) -> None:
        """Time `Host.run`, and `acknowledge`, the sender of acks.

        The first grant is left out: since being ready, a host has waited for the first grant.
        """
        watch = self.process.watch
        self.process.attach(host, self._has_run)
        watch.time(acknowledge, watch.phase("acks", "connections"))

    def _has_run(self) -> None:
        if self._began:
            self.process.watch.next_round()
        else:
            self.process.restart()
        self._began = True

    def _answer(self, query: zenoh.Query) -> None:
        profile = Profile(
            session=self._session_name,
            run=self._run,
            sim_time_ns=0,
            wall_time_ns=0,
            steps=0,
            rows=self.process.rows(),
        )
        with query:
            query.reply(self._key, encode(profile), encoding=zenoh.Encoding.APPLICATION_CDR)

    def undeclare(self) -> None:
        """Answer no more."""
        self._queryable.undeclare()
