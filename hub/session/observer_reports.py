"""Reports of a session's observers, and the lost observers: the session goes on without a lost observer."""

from __future__ import annotations

import logging
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.observation.summary import Observed
from hub.participant.token_bucket import TokenBucket
from hub.transport.run_connection import RunConnection
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.trocar_msgs import Latency, ObserverStatus

__all__ = ["ObserverReports"]

log = logging.getLogger(__name__)

_RATE = 10.0
"""Most statuses per second accepted for each observer; a host sends one a second."""


class ObserverReports:
    """Receives the statuses of all observers, and keeps the causes of losses; from any thread."""

    def __init__(self, run: RunConnection) -> None:
        self._keys, self._refusals = run.keys, run.refusals
        self._names = [observer.name for observer in run.plan.observers()]
        self._statuses: dict[str, ObserverStatus] = {}
        self._lost: dict[str, str] = {}
        self._limit = TokenBucket(_RATE * (1.0 + len(self._names)))
        self._subscriber = run.session.declare_subscriber(
            run.keys.observer_status("*"), Callback(self._receive, indirect=False)
        )

    def lose(self, observer: str, cause: str) -> None:
        """Report the first loss of an observer; `cause` is a clause."""
        if observer not in self._lost:
            self._lost = {**self._lost, observer: cause}
            log.error("observer '%s' is lost, the session goes on without it: %s", observer, cause)

    def find(self, observer: str) -> None:
        """Report the return of an observer."""
        self._lost = {name: cause for name, cause in self._lost.items() if name != observer}

    @property
    def lost(self) -> str:
        """Lost observers and the causes; empty if no observer is lost."""
        return "; ".join(f"observer '{name}' is lost: {cause}" for name, cause in self._lost.items())

    @property
    def latencies(self) -> list[Latency]:
        """How long states took to the observers."""
        return [latency for _, status in sorted(self._statuses.items()) for latency in status.latencies]

    def step(self, observer: str) -> int:
        """Return the step of the last state seen by an observer; -1 before the first report."""
        status = self._statuses.get(observer)
        return -1 if status is None else status.step

    def observed_states(self) -> dict[str, Observed]:
        """Return the reports of states seen, by observer."""
        rows: dict[str, Observed] = {}
        for name in self._names:
            status, lost = self._statuses.get(name), self._lost.get(name)
            if status is None:
                rows[name] = Observed(0, 0, 0.0, 0.0, lost)
            else:
                rates = status.rate, status.attainable_rate
                rows[name] = Observed(status.states, status.dropped, *rates, lost)
        return rows

    def _receive(self, sample: zenoh.Sample) -> None:
        try:
            if not self._limit.spend(monotonic_ns()):
                raise MessageError("observers report their status more often than they may")
            status = decode(ObserverStatus, sample.payload.to_bytes())
            name = status.observer
            if name not in self._names or str(sample.key_expr) != self._keys.observer_status(name):
                raise MessageError(f"reports on '{name}', which is no observer of this name here")
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)
            return
        self._statuses = {**self._statuses, name: status}  # other threads may be iterating over the old one

    def undeclare(self) -> None:
        """Receive no more."""
        self._subscriber.undeclare()
