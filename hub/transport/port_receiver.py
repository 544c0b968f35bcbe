"""Receives the values of an output port of another process from Zenoh."""

from __future__ import annotations

from typing import Any

import zenoh
from zenoh.handlers import FifoChannel

from hub.planning.plan import PlannedParticipant
from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.port_codec import PortCodec
from hub.transport.run_connection import RunConnection
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import Port

__all__ = ["PortReceiver"]


class PortReceiver:
    """Receives the values of an output port of another process, in order.

    Invalid messages and messages of another run are refused and counted.
    """

    def __init__(self, run: RunConnection, planned: PlannedParticipant, port: Port) -> None:
        self._codec = PortCodec(port)
        self._run = run
        self._newest = self._batch_step = INITIAL - 1
        self._batch: tuple[Message, ...] = ()
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
            tag = Tag.of(sample)
            if tag.run != self._run.number:
                raise MessageError(f"belongs to run {tag.run:x}, this is run {self._run.number:x}")
            if tag.step <= self._newest:
                if tag.step == INITIAL:
                    return None  # it is repeated until every host has it
                raise MessageError(f"the value of step {tag.step} has arrived already")
            payload = sample.payload.to_bytes()
            value = self._add_to_batch(tag, payload) if self._codec.is_event else self._codec.decode(payload)
        except MessageError as error:
            self._run.refusals.refuse_sample(sample, error)
            return None
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

    def close(self) -> None:
        """Stop receiving."""
        self._subscriber.undeclare()
