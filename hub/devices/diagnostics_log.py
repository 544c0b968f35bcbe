"""The diagnoses of devices on other machines, in the hub's log: name of the device, and advice.

Devices started by the session write to the same terminal.
"""

from __future__ import annotations

import logging
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.participant.token_bucket import TokenBucket
from hub.transport.run_connection import RunConnection
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.ros import DiagnosticStatus

__all__ = ["DiagnosticsLog"]

log = logging.getLogger(__name__)

_LONGEST = 500
"""Characters logged of a message from elsewhere."""


_RATE = 10.0
"""Diagnoses of a port accepted in a second."""


class DiagnosticsLog:
    """Logs the diagnoses of remote devices, connected or not."""

    def __init__(self, run: RunConnection) -> None:
        self._refusals = run.refusals
        ports = [
            (planned.name, port.name)
            for planned in run.plan.participants.values()
            if planned.role == "device" and planned.host.startswith("remote/")
            for port in planned.ports
            if port.causality == "output" and port.type == DiagnosticStatus.ros_type
        ]
        self._last: dict[str, tuple[int, str]] = {}
        self._subscribers = [
            run.session.declare_subscriber(
                run.keys.output("device", *source), self._listener("/".join(source))
            )
            for source in ports
        ]

    def _listener(self, source: str) -> Callback[zenoh.Sample]:
        limit = TokenBucket(_RATE)

        def receive(sample: zenoh.Sample) -> None:
            try:
                if not limit.spend(monotonic_ns()):
                    raise MessageError(f"more than {_RATE:g} diagnoses/s")
                status = decode(DiagnosticStatus, sample.payload.to_bytes())
            except MessageError as error:
                self._refusals.refuse_sample(sample, error)
                return
            text = " ".join(status.message.split())[:_LONGEST]  # on one line, whatever was sent
            if self._last.get(source) != (status.level, text):
                self._last[source] = status.level, text
                log.log(
                    logging.WARNING if status.level else logging.INFO,
                    "device '%s' reports: %s",
                    source.removesuffix("/diagnostics"),
                    text,
                )

        return Callback(receive, indirect=True)

    def undeclare(self) -> None:
        """Receive no more."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
