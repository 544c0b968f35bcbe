"""Receives what stepped participants of other processes report: acks of grants, and failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

import zenoh
from zenoh.handlers import FifoChannel

from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.envelope import signature
from hub.transport.refusals import Refusals
from schemas.errors import MessageError, ParticipantError
from schemas.keys import Keys
from schemas.lockstep import Ack, Grant, unpack_ack

__all__ = ["Accepted", "AckReceiver"]

Accepted = tuple[PlannedParticipant, Ack, bytes]
"""The participant, its ack, and the bytes of it."""

_NO_STEPS: Mapping[str, int] = {}


class AckReceiver:
    """Receives the acks of one run, one of each participant for each grant.

    A second one, and one that the participant's host has not signed, end the run: of two acks, only one can
    have the hashes of what was computed. All other messages are refused and counted.

    Args:
        session: The hub's Zenoh session.
        keys: The keys of the session.
        plan: The plan of the session.
        run: The number of the run.
        refusals: Counts the messages that are refused.
        ack_keys: By host, the key with which it signs.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        plan: Plan,
        run: int,
        refusals: Refusals,
        ack_keys: Mapping[str, bytes],
    ) -> None:
        self._session, self._key, self._run, self._refusals = session, keys.ack("hub"), run, refusals
        self._planned = {keys.ack(name): plan.participants[name] for name in plan.order}
        self._ack_keys = ack_keys
        self._last: dict[str, bytes] = {}
        """The last ack of each participant."""
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
        if str(sample.key_expr) == self._key and not sample.payload:
            return None
        try:
            planned, payload, signed = self._opened(sample)
            count = steps.get(planned.name, 0)
            try:
                ack = unpack_ack(payload, count, count * len(planned.bonds))
            except MessageError as error:
                if signed:
                    raise ParticipantError(planned.name, step, f"its host has sent {error}") from error
                raise
            if ack.run != self._run:
                raise MessageError(f"belongs to run {ack.run:x}, this is run {self._run:x}")
            self._check(planned, ack, payload, signed=signed)
            if planned.name not in waiting or ack.step != step:
                raise ParticipantError(
                    planned.name,
                    ack.step,
                    "a second ack of it has arrived, or one of a step that was not granted: is its host"
                    f" '{planned.host}' running twice?",
                )
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)
            return None
        self._last[planned.name] = payload
        return planned, ack, payload

    def _opened(self, sample: zenoh.Sample) -> tuple[PlannedParticipant, bytes, bool]:
        """Return the participant that a message is of, its payload, and whether its host has signed it."""
        planned = self._planned.get(str(sample.key_expr))
        if planned is None:
            raise MessageError("belongs to no participant of this run")
        payload = sample.payload.to_bytes()
        attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
        return planned, payload, attached == signature(payload, self._ack_keys[planned.host])

    def _check(self, planned: PlannedParticipant, ack: Ack, payload: bytes, *, signed: bool) -> None:
        """Raise ParticipantError if an ack of this run is not its host's, or reports a failure."""
        if not signed:
            raise ParticipantError(
                planned.name,
                ack.step,
                f"an ack of it has arrived that its host '{planned.host}' did not send: another process of"
                " this user takes part in the session",
            )
        if ack.error:
            raise ParticipantError(planned.name, ack.step, ack.error)
        if payload == self._last.get(planned.name):
            raise MessageError(f"repeats the ack of step {ack.step}")

    def raise_failure(self) -> None:
        """Raise the failure that a participant itself has reported, if such a message has arrived."""
        while (sample := self._subscriber.try_recv()) is not None:
            with suppress(MessageError):
                planned, payload, signed = self._opened(sample)
                ack = unpack_ack(payload, 0, 0)
                if signed and ack.run == self._run and ack.error:
                    raise ParticipantError(planned.name, ack.step, ack.error)

    def end(self, step: int) -> None:
        """Raise ParticipantError if an ack has arrived after the last grant's, which ended at `step`.

        It must be called when all have arrived.
        """
        while (sample := self._subscriber.try_recv()) is not None:
            self._accept(sample, (), step, _NO_STEPS)

    def wake(self) -> None:
        """Make `receive` return."""
        self._session.put(self._key, b"")
