"""Receives what stepped participants of other processes report: acks of grants, and failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import zenoh
from zenoh.handlers import FifoChannel

from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.refusals import Refusals
from schemas.errors import MessageError, ParticipantError
from schemas.keys import Keys
from schemas.lockstep import Ack, Grant, unpack_ack

__all__ = ["Accepted", "AckReceiver"]

Accepted = tuple[PlannedParticipant, Ack, bytes]
"""The participant, its ack, and the bytes of it."""

_NO_STEPS: Mapping[str, int] = {}


class AckReceiver:
    """Receives the acks of one run; all other messages are refused and counted."""

    def __init__(self, session: zenoh.Session, keys: Keys, plan: Plan, run: int, refusals: Refusals) -> None:
        self._session, self._key, self._run, self._refusals = session, keys.ack("hub"), run, refusals
        self._planned = {keys.ack(name): plan.participants[name] for name in plan.order}
        self._subscriber = session.declare_subscriber(keys.ack("*"), FifoChannel(4096))

    def receive(self, waiting: Sequence[str], grant: Grant, steps: Mapping[str, int]) -> Accepted | None:
        """Wait for a message, and return it if it is a valid ack of `grant` from one of `waiting`.

        `steps` are the numbers of steps that participants take in the grant. Returns None for any other
        message, and when `wake` was called. Raises ParticipantError if the message reports a failure.
        """
        return self._accept(self._subscriber.recv(), waiting, grant.step, steps)

    def ready(self, waiting: Sequence[str]) -> str | None:
        """Return the one of `waiting` that reports to be ready, if its message has arrived.

        Raises ParticipantError if it reports a failure.
        """
        sample = self._subscriber.try_recv()
        accepted = None if sample is None else self._accept(sample, waiting, -1, _NO_STEPS)
        return None if accepted is None else accepted[0].name

    def _accept(
        self, sample: zenoh.Sample, waiting: Sequence[str], step: int, steps: Mapping[str, int]
    ) -> Accepted | None:
        key = str(sample.key_expr)
        if key == self._key and not sample.payload:
            return None
        try:
            planned = self._planned.get(key)
            if planned is None:
                raise MessageError("belongs to no participant of this run")
            payload = sample.payload.to_bytes()
            count = steps.get(planned.name, 0)
            ack = unpack_ack(payload, count, count * len(planned.bonds))
            if ack.run != self._run:
                raise MessageError(f"belongs to run {ack.run:x}, this is run {self._run:x}")
            if ack.error:
                raise ParticipantError(planned.name, ack.step, ack.error)
            if planned.name not in waiting or ack.step != step:
                raise MessageError(f"acknowledges step {ack.step}, which is not awaited")
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)
            return None
        return planned, ack, payload

    def raise_failure(self) -> None:
        """Raise the failure that a participant itself has reported, if such a message has arrived."""
        while (sample := self._subscriber.try_recv()) is not None:
            planned = self._planned.get(str(sample.key_expr))
            with suppress(MessageError):
                ack = unpack_ack(sample.payload.to_bytes(), 0, 0)
                if planned is not None and ack.run == self._run and ack.error:
                    raise ParticipantError(planned.name, ack.step, ack.error)

    def wake(self) -> None:
        """Make `receive` return."""
        self._session.put(self._key, b"")
