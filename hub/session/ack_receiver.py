"""Receives the reports of stepped participants of remote processes: acks of grants, and failures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from hmac import compare_digest

import zenoh
from zenoh.handlers import FifoChannel

from hub.planning.plan import PlannedParticipant
from hub.transport.envelope import signature
from hub.transport.host_link import HubLink
from hub.transport.run_connection import RunConnection
from schemas.errors import MessageError, ParticipantError
from schemas.lockstep import Ack, Grant, unpack_ack

__all__ = ["Accepted", "AckReceiver"]

Accepted = tuple[PlannedParticipant, Ack, bytes]
"""The participant, the ack, and the bytes of the ack."""

_READY = -1
"""The step in the ack of a participant ready to step."""
_NO_STEPS: Mapping[str, int] = {}


class AckReceiver:
    """Receives the acks of a run, one of each participant for each grant.

    A host with a link answers by the link alone; all further hosts answer over Zenoh, signed. A second ack,
    or an ack not sent by the participant's host, ends the run: of two acks, only one can have the hashes of
    the computed states. All further messages are refused and counted.

    Args:
        run: The hub's connection to the run.
        ack_keys: Keys of the signatures, by host.
        links: Links, by host.
    """

    def __init__(
        self, run: RunConnection, ack_keys: Mapping[str, bytes], links: Mapping[str, HubLink]
    ) -> None:
        keys, plan = run.keys, run.plan
        self._run = run
        self._wake_key = keys.ack("hub")
        self._planned = {keys.ack(name): plan.participants[name] for name in plan.order}
        self._ack_keys, self._links = ack_keys, links
        self._linked_host = {
            name: planned.host for name in plan.order if (planned := plan.participants[name]).host in links
        }
        self._last: dict[str, bytes] = {}
        """The last ack of each participant."""
        self._step, self._steps = _READY, _NO_STEPS
        """Step of the grant awaiting acks, and the numbers of steps by participant."""
        self._subscriber = run.session.declare_subscriber(keys.ack("*"), FifoChannel(4096))

    def receive(self, waiting: Sequence[str], grant: Grant, steps: Mapping[str, int]) -> Iterator[Accepted]:
        """Wait a moment for messages, and yield the valid acks of `grant` from `waiting`, which may shrink.

        `steps` are the participants' numbers of steps in the grant. Without an ack the wait ends after 20 ms
        or, if all of `waiting` answer over Zenoh, after a message or `wake`. Raises ParticipantError if
        a message reports a failure.
        """
        self._step, self._steps = grant.step, steps
        hosts = list(dict.fromkeys(self._linked_host[name] for name in waiting if name in self._linked_host))
        if not hosts:
            yield from self._from_zenoh(self._subscriber.recv(), waiting)
            return
        yield from self.look(waiting)
        # the last in step order first: when it has answered, most others have, and this process wakes up once
        for host in reversed(hosts):
            yield from self._from_link(host, waiting, wait=host == hosts[-1])

    def ready(self, waiting: Sequence[str]) -> Iterator[str]:
        """Yield those of `waiting` that report readiness; raises ParticipantError if one has failed."""
        for host in self._links:
            for planned, *_ in self._from_link(host, waiting, wait=False):
                yield planned.name
        for planned, *_ in self.look(waiting):
            yield planned.name

    def look(self, waiting: Sequence[str] = ()) -> Iterator[Accepted]:
        """Yield the acks of `waiting` that have arrived over Zenoh; raises ParticipantError for any other."""
        while (sample := self._subscriber.try_recv()) is not None:
            yield from self._from_zenoh(sample, waiting)

    def _from_link(self, host: str, waiting: Sequence[str], *, wait: bool) -> Iterator[Accepted]:
        for name, payload in self._links[host].acks(wait=wait):
            key = self._run.keys.ack(name)
            try:
                accepted = self._accept(self._planned[key], payload, waiting, signed=True)
            except MessageError as error:
                self._run.refusals.refuse(key, error)
            else:
                yield accepted

    def _from_zenoh(self, sample: zenoh.Sample, waiting: Sequence[str]) -> Iterator[Accepted]:
        if str(sample.key_expr) == self._wake_key and not sample.payload:
            return
        try:
            planned, payload, signed = self._open_message(sample)
            accepted = self._accept(planned, payload, waiting, signed=signed)
        except MessageError as error:
            self._run.refusals.refuse_sample(sample, error)
        else:
            yield accepted

    def _accept(
        self, planned: PlannedParticipant, payload: bytes, waiting: Sequence[str], *, signed: bool
    ) -> Accepted:
        """Return an awaited ack; raises ParticipantError, or MessageError if none of the run."""
        count = self._steps.get(planned.name, 0)
        try:
            ack = unpack_ack(payload, count, count * len(planned.bonds))
        except MessageError as error:
            if signed:
                raise ParticipantError(planned.name, self._step, f"its host has sent {error}") from error
            raise
        if ack.run != self._run.number:
            raise MessageError(f"belongs to run {ack.run:x}, this is run {self._run.number:x}")
        self._check(planned, ack, payload, signed=signed)
        if planned.name not in waiting or ack.step != self._step:
            raise ParticipantError(
                planned.name,
                ack.step,
                "a second ack of it has arrived, or one of a step that was not granted: is its host"
                f" '{planned.host}' running twice?",
            )
        self._last[planned.name] = payload
        return planned, ack, payload

    def _open_message(self, sample: zenoh.Sample) -> tuple[PlannedParticipant, bytes, bool]:
        """Return the participant of a message, the payload, and whether the message is signed by the host.

        A host with a link does not sign.
        """
        planned = self._planned.get(str(sample.key_expr))
        if planned is None:
            raise MessageError("belongs to no participant of this run")
        payload = sample.payload.to_bytes()
        attached = b"" if sample.attachment is None else sample.attachment.to_bytes()
        signed = planned.host not in self._links and compare_digest(
            attached, signature(payload, self._ack_keys[planned.host])
        )
        return planned, payload, signed

    def _check(self, planned: PlannedParticipant, ack: Ack, payload: bytes, *, signed: bool) -> None:
        """Raise ParticipantError if an ack of this run is not from its host, or reports a failure."""
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
        """Raise a failure reported by a participant itself, if such a message has arrived."""
        for name, payload in self._arrived_messages():
            with suppress(MessageError):
                ack = unpack_ack(payload, 0, 0)
                if ack.run == self._run.number and ack.error:
                    raise ParticipantError(name, ack.step, ack.error)

    def _arrived_messages(self) -> Iterator[tuple[str, bytes]]:
        """Yield participant and payload of every arrived message of a host."""
        for link in self._links.values():
            while acks := link.acks(wait=False):
                yield from acks
        while (sample := self._subscriber.try_recv()) is not None:
            with suppress(MessageError):
                planned, payload, signed = self._open_message(sample)
                if signed:
                    yield planned.name, payload

    def end(self, step: int) -> None:
        """Raise ParticipantError if an ack has arrived after the acks of the last grant, ended at `step`.

        Call this after the arrival of all acks.
        """
        self._step, self._steps = step, _NO_STEPS
        for _ in self.ready(()):
            pass

    def wake(self) -> None:
        """Make `receive` return."""
        self._run.session.put(self._wake_key, b"")
