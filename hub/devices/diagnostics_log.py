"""What devices on other machines say of their condition, in the hub's log: whoever runs the session reads
which device it is and what to do.

Those that the session has started itself log the same where everybody sees it.
"""

from __future__ import annotations

import logging
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.participant.token_bucket import TokenBucket
from hub.planning.plan import Plan
from hub.transport.refusals import Drops
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.keys import Keys
from schemas.ros import DiagnosticStatus

__all__ = ["Complaints"]

log = logging.getLogger(__name__)

_LONGEST = 500
"""Characters of a message from elsewhere that are logged."""


_RATE = 10.0
"""Diagnoses of one device that are looked at in a second."""


class Complaints:
    """Listens to the diagnoses of remote devices, whether or not they are connected to anything."""

    def __init__(self, plan: Plan, keys: Keys, session: zenoh.Session, drops: Drops) -> None:
        """`drops` counts what is no diagnosis."""
        self._drops = drops
        ports = [
            (planned.name, port.name)
            for planned in plan.participants.values()
            if planned.role == "device" and planned.host.startswith("remote/")
            for port in planned.ports
            if port.causality == "output" and port.type == DiagnosticStatus.ros_type
        ]
        self._last: dict[str, tuple[int, str]] = {}
        self._subscribers = [
            session.declare_subscriber(keys.output("device", *source), self._listener("/".join(source)))
            for source in ports
        ]

    def _listener(self, source: str) -> Callback[zenoh.Sample]:
        allowance = TokenBucket(_RATE)

        def hear(sample: zenoh.Sample) -> None:
            try:
                if not allowance.spend(monotonic_ns()):
                    raise MessageError(f"more than {_RATE:g} diagnoses/s")
                status = decode(DiagnosticStatus, sample.payload.to_bytes())
            except MessageError as error:
                self._drops.count(sample, error)
                return
            said = " ".join(status.message.split())[:_LONGEST]  # on one line, whoever it is from
            if self._last.get(source) != (status.level, said):
                self._last[source] = status.level, said
                log.log(
                    logging.WARNING if status.level else logging.INFO,
                    "device '%s' says: %s",
                    source.removesuffix("/diagnostics"),
                    said,
                )

        return Callback(hear, indirect=True)

    def close(self) -> None:
        """Listen no more."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
