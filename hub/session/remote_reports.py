"""Reports of remote processes beside acks: arrival, departure, and refused messages."""

from __future__ import annotations

import logging

import zenoh
from zenoh.handlers import Callback

from hub.devices.session_devices import SessionDevices
from hub.session.bookkeeping import Bookkeeping
from hub.session.first_failure import FirstFailure
from hub.session.joined_hosts import JoinedHosts
from hub.session.observer_reports import ObserverReports
from hub.transport.run_connection import RunConnection
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.ros import StringMessage

__all__ = ["RemoteReports"]

log = logging.getLogger(__name__)


class RemoteReports:
    """Subscribes to liveliness tokens and refusals of all hosts of a session.

    A lost engine of another machine ends the run; with a lost device, the participants led by the device
    hold; a lost observer leads nothing.
    """

    def __init__(
        self,
        run: RunConnection,
        devices: SessionDevices,
        joined_hosts: JoinedHosts,
        bookkeeping: Bookkeeping,
        failure: FirstFailure,
        observer_reports: ObserverReports,
    ) -> None:
        self._observer_reports = observer_reports
        self._plan, self._devices, self._joined_hosts = run.plan, devices, joined_hosts
        self._bookkeeping, self._failure, self._refusals = bookkeeping, failure, run.refusals
        session = run.session
        self._subscribers = [
            session.liveliness().declare_subscriber(run.keys.alive("*", "*"), Callback(self._token)),
            session.declare_subscriber(run.keys.dropped_messages("*", "*"), Callback(self._count_refusal)),
        ]

    def _token(self, sample: zenoh.Sample) -> None:
        """Handle the appearance or disappearance of a liveliness token."""
        name = str(sample.key_expr).rsplit("/", 1)[1]
        planned = self._plan.participants.get(name)
        if planned is None or not planned.host.startswith("remote/"):
            return
        if sample.kind != zenoh.SampleKind.DELETE:
            if planned.role == "device":
                self._devices.network_links.repeat(name)
            self._observer_reports.find(name)
            return
        self._joined_hosts.lose(planned.host)
        if planned.role == "device":
            self._devices.forget(name)
        if self._bookkeeping.phase not in ("starting", "running", "paused"):
            return
        if planned.observer:
            self._observer_reports.lose(name, f"its host is gone; start 'trocar engine {name}' again")
            return
        if planned.role != "device":
            self._failure.report(name, "its host is gone")
            return
        log.warning(
            "device '%s' is gone, what it leads holds: start 'trocar device %s' again, or mend the"
            " network; a host that still runs joins again",
            name,
            name,
        )

    def _count_refusal(self, sample: zenoh.Sample) -> None:
        """Count a message refused by another host; the host has logged the reason."""
        try:
            decode(StringMessage, sample.payload.to_bytes())
            self._refusals.add(str(sample.key_expr))
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)

    def undeclare(self) -> None:
        """Receive no more reports."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
