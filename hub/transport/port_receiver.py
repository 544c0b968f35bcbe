"""Receives the values of an output port of another process, from Zenoh or a host of this machine."""

from __future__ import annotations

from typing import Any

import zenoh
from zenoh.handlers import FifoChannel

from hub.planning.plan import PlannedParticipant
from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.local_values import LocalOutput
from hub.transport.port_codec import PortCodec
from hub.transport.run_connection import RunConnection
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import Port

__all__ = ["LocalReceiver", "ZenohReceiver"]


class _Decoder:
    """Decodes the messages of an output port of run `run`, in order."""

    def __init__(self, run: int, port: Port) -> None:
        self._codec = PortCodec(port)
        self._run = run
        self._newest = self._batch_step = INITIAL - 1
        self._batch: tuple[Message, ...] = ()

    def decode(self, tag: Tag, payload: bytes) -> tuple[int, Any] | None:
        """Return the step in the tag, and the value; None until all events of a step have arrived.

        Raises MessageError for invalid messages, and for messages of another run.
        """
        if tag.run != self._run:
            raise MessageError(f"belongs to run {tag.run:x}, this is run {self._run:x}")
        if tag.step <= self._newest:
            if tag.step == INITIAL:
                return None  # it is repeated until every host has it
            raise MessageError(f"the value of step {tag.step} has arrived already")
        value = self._add_to_batch(tag, payload) if self._codec.is_event else self._codec.decode(payload)
        if value is None:
            return None
        self._newest = tag.step
        return tag.step, value

    def _add_to_batch(self, tag: Tag, payload: bytes) -> tuple[Message, ...] | None:
        """Add an event to the events of the same step; return all events of the step when complete."""
        batch = self._batch if tag.step == self._batch_step else ()
        if tag.index != len(batch):
            raise MessageError(
                f"event {tag.index} of step {tag.step} arrived where event {len(batch)} is next"
            )
        events = (self._codec.decode(payload),) if payload or tag.count else ()
        self._batch_step, self._batch = tag.step, (*batch, *events)
        return self._batch if tag.index + 1 >= tag.count else None


class ZenohReceiver:
    """Receives the values of an output port over Zenoh; refuses and counts invalid messages."""

    def __init__(self, run: RunConnection, planned: PlannedParticipant, port: Port) -> None:
        self._decoder, self._refusals = _Decoder(run.number, port), run.refusals
        key = run.keys.output(planned.key_role, planned.name, port.name)
        self._subscriber = run.session.declare_subscriber(key, FifoChannel(4096))

    def receive(self) -> tuple[int, Any]:
        """Wait for the next valid value; return the step in the tag, and the value."""
        while True:
            arrived = self._accept(self._subscriber.recv())
            if arrived is not None:
                return arrived

    def poll(self) -> tuple[int, Any] | None:
        """Return the next valid value if any has arrived."""
        while (sample := self._subscriber.try_recv()) is not None:
            arrived = self._accept(sample)
            if arrived is not None:
                return arrived
        return None

    def _accept(self, sample: zenoh.Sample) -> tuple[int, Any] | None:
        try:
            return self._decoder.decode(Tag.of(sample), sample.payload.to_bytes())
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)
            return None

    def close(self) -> None:
        """Stop receiving."""
        self._subscriber.undeclare()


class LocalReceiver:
    """Receives the values of an output port from a host of this machine."""

    def __init__(self, run: RunConnection, port: Port, output: LocalOutput) -> None:
        self._decoder, self._output = _Decoder(run.number, port), output

    def receive(self) -> tuple[int, Any]:
        """Wait for the next value; return the step in the tag, and the value."""
        while True:
            arrived = self._next(wait=True)
            if arrived is not None:
                return arrived

    def poll(self) -> tuple[int, Any] | None:
        """Return the next value if any has arrived."""
        return self._next(wait=False)

    def _next(self, *, wait: bool) -> tuple[int, Any] | None:
        while (data := self._output.receive(wait=wait)) is not None:
            arrived = self._decoder.decode(Tag.unpack(data[: Tag.SIZE]), data[Tag.SIZE :])
            if arrived is not None:
                return arrived
        return None
