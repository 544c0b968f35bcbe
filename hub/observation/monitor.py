"""Watches a run without taking part: feeds recorder, measures and energy books.

Recording costs a step little more than copying the bytes: the vectors of a participant due together are
handed to the recorder as a single row of bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
import zenoh

from hub.observation.energy import EnergyBooks
from hub.observation.measures import Measures
from hub.participant import Sample, VectorSample
from hub.planning.plan import Plan, PlannedParticipant
from hub.recording.chunk import Queued
from hub.recording.recorder import Recorder
from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.port_codec import PortCodec
from hub.transport.refusals import Refusals
from schemas.codec import encode
from schemas.errors import MessageError
from schemas.keys import Keys, topic
from schemas.lockstep import Ack, Grant, pack_ack
from schemas.ports import Port
from schemas.trocar_msgs import (
    AckMessage,
    CouplingEnergy,
    GrantMessage,
    Profile,
    SessionStatus,
)

__all__ = ["Monitor"]

_ENERGY_PERIOD_NS = 10_000_000
"""The books change at every step; 100 Hz is enough for a plot."""


@dataclass
class _Watched:
    planned: PlannedParticipant
    port: Port
    codec: PortCodec
    channel: int
    newest: tuple[int, int] = (INITIAL - 1, 0)
    """Step of the last value, and place in the step's batch."""
    complete: int = INITIAL - 1
    """The last step with all values received."""


class Monitor:
    """Receives every grant, ack and output value of a run, from this process or from others."""

    def __init__(
        self, plan: Plan, keys: Keys, run: int, measures: Measures, recorder: Recorder | None
    ) -> None:
        self.measures = measures
        self.energy = EnergyBooks(plan)
        self.refusals = Refusals()
        self._run = run
        self._plan = plan
        self._keys = keys
        self._recorder = recorder
        self._watched: dict[str, _Watched] = {}
        self._by_port: dict[tuple[str, str], _Watched] = {}
        """The same, by participant and port: to make a key takes as long as to record a message."""
        self._channels: dict[str, int] = {}
        self._ack_channels: dict[str, int] = {}
        self._unrecorded: list[Queued] = []
        """Messages passed on by the step loop, not yet with the recorder."""
        self._next_energy_ns = 0
        for planned in plan.participants.values():
            for port in planned.ports:
                if port.causality == "output":
                    key = keys.output(planned.key_role, planned.name, port.name)
                    watched = _Watched(planned, port, PortCodec(port), self._channel_number(key, port.type))
                    self._watched[key] = self._by_port[planned.name, port.name] = watched

    def _channel_number(self, key: str, type_name: str) -> int:
        if self._recorder is None:
            return 0
        if key not in self._channels:
            self._channels[key] = self._recorder.add_channel(topic(key), type_name)
        return self._channels[key]

    @property
    def remote_outputs(self) -> dict[str, tuple[str, str]]:
        """Participant and port of every recorded or measured output of another process, by key."""
        return {
            key: (w.planned.name, w.port.name)
            for key, w in self._watched.items()
            if w.planned.host != "hub"
            and w.planned.role != "device"
            and self.watches(w.planned.name, w.port.name)
        }

    def has_start_values(self) -> bool:
        """Return whether the value at time 0 of every watched output of another process was received.

        Values of participants that only look may come later.
        """
        return all(
            self._watched[key].newest >= (INITIAL, 0)
            for key in self.remote_outputs
            if self._watched[key].planned.in_step
        )

    def vectors_listener(
        self, planned: PlannedParticipant, ports: Sequence[Port]
    ) -> Callable[[int, int, bytes], None] | None:
        """Return the receiver of a participant's vectors in this process.

        The arguments are the step, the time (ns) of validity, and the bytes of the vectors in their order.
        None: nothing receives the vectors.
        """
        watched = [self._output(planned, port) for port in ports]
        vectors = [(one.channel, one.codec.vector) for one in watched if one.codec.vector is not None]
        block = None if self._recorder is None else self._recorder.add_block(vectors)
        ends = list(accumulate(8 * codec.size for _, codec in vectors))
        measured = [
            (port.name, slice(end - 8 * codec.size, end))
            for port, end, (_, codec) in zip(ports, ends, vectors, strict=True)
            if (planned.name, port.name) in self.measures.by_port
        ]
        if block is None and not measured:
            return None

        def receive(step: int, time_ns: int, data: bytes) -> None:
            if block is not None:
                self._unrecorded.append((block, time_ns, data))
            for port, part in measured if step > INITIAL else ():
                self.measures.add(planned.name, port, np.frombuffer(data[part]), time_ns)

        return receive

    def listener(
        self, planned: PlannedParticipant, codec: PortCodec
    ) -> Callable[[int, int, Any], None] | None:
        """Return the receiver of a message or of the events of a participant in this process.

        The arguments are the step, the time (ns) of validity, and the value. None: nothing receives the
        value.
        """
        is_recorded, port = self._recorder is not None, codec.port
        is_measured = (planned.name, port.name) in self.measures.by_port
        if not is_recorded and not is_measured:
            return None
        channel = self._output(planned, port).channel

        def receive(step: int, time_ns: int, value: Any) -> None:
            for message in value if codec.is_event else (value,):
                if is_measured and step > INITIAL:
                    self.measures.add(planned.name, port.name, message, time_ns)
                if is_recorded:
                    self._unrecorded.append((channel, time_ns, codec.encode(message, time_ns)))

        return receive

    def _output(self, planned: PlannedParticipant, port: Port) -> _Watched:
        return self._by_port[planned.name, port.name]

    def has_received(self, end: int) -> bool:
        """Return whether all values of the steps before `end` have arrived from other processes.

        A host with a link may acknowledge a step before Zenoh has delivered the step's values.
        """
        watched = (self._watched[key] for key in self.remote_outputs)
        return all(one.complete >= self._last_due(one, end) for one in watched if one.planned.in_step)

    def _last_due(self, watched: _Watched, end: int) -> int:
        """Return the last step before `end` with a publication of a watched output."""
        period = watched.planned.period
        stride = self._plan.output_stride(watched.planned.name, watched.port.name)
        steps = range((end - 1) // period * period, -1, -period)
        return next((step for step in steps if (step + period) % stride == 0), INITIAL)

    def sample(self, sample: zenoh.Sample) -> None:
        """Receive an output value of a participant in another process, from the wire."""
        watched = self._watched.get(str(sample.key_expr))
        try:
            tag = Tag.of(sample)
            if watched is None or tag.run != self._run:
                raise MessageError("belongs to no port of this run")
            if (tag.step, tag.index) <= watched.newest:
                return
            if not tag.count:
                watched.newest, watched.complete = (tag.step, 0), tag.step
                return
            payload = sample.payload.to_bytes()
            value = watched.codec.decode(payload)
        except MessageError as error:
            self.refusals.refuse_sample(sample, error)
            return
        watched.newest = (tag.step, tag.index)
        if tag.index + 1 == tag.count:
            watched.complete = tag.step
        if tag.step > INITIAL:
            self.measures.add(watched.planned.name, watched.port.name, value, tag.time_ns)
        if self._recorder is not None:
            self._recorder.write(watched.channel, tag.time_ns, payload)

    def watches(self, participant: str, port: str) -> bool:
        """Return whether recorder or measures use an output, for a device even an unconnected output."""
        return self._recorder is not None or (participant, port) in self.measures.by_port

    def device(self, device: str, port: str, time_ns: int, payload: bytes, *, enters: bool) -> None:
        """Receive a message of a device from the wire.

        A message entering the simulation is recorded with its grant. Raises MessageError if the message does
        not fit the port.
        """
        watched = self._measure(device, port, time_ns, payload, checked=enters)
        if self._recorder is not None and not enters:
            self._recorder.write(watched.channel, time_ns, payload)

    def device_here(self, device: str, sample: Sample, time_ns: int, payload: bytes, *, enters: bool) -> None:
        """Receive a sample of a device in this process, and its bytes, in the thread of the step loop.

        Otherwise like `device`.
        """
        codec = self._by_port[device, sample.port].codec
        checked = enters or (isinstance(sample, VectorSample) and sample.is_of(codec.vector))
        watched = self._measure(device, sample.port, time_ns, payload, checked=checked)
        if self._recorder is not None and not enters:
            self._unrecorded.append((watched.channel, time_ns, payload))

    def _measure(self, device: str, port: str, time_ns: int, payload: bytes, *, checked: bool) -> _Watched:
        """Measure a device's message; raise MessageError if it fails the check, unless already `checked`."""
        watched = self._by_port[device, port]
        measured = (device, port) in self.measures.by_port
        if measured or not checked:
            value = watched.codec.accept(payload)
            if measured:
                self.measures.add(device, port, value, time_ns)
        return watched

    def grant(self, grant: Grant, payload: bytes) -> None:
        """Receive a grant and the grant's device samples."""
        if self._recorder is None:
            return
        time_ns = grant.start_ns
        self._unrecorded.append(
            (self._channel_number(self._keys.grant, GrantMessage.ros_type), time_ns, payload)
        )
        for one in grant.inlets:
            watched, held = self._by_port.get((one.participant, one.port)), one.payload
            if watched is not None and held.size:
                self._unrecorded.append((watched.channel, time_ns, held.tobytes()))

    def ack(self, planned: PlannedParticipant, ack: Ack, time_ns: int, payload: bytes | None) -> None:
        """Receive an ack; `payload` holds the bytes of an ack from the wire."""
        self.energy.book_work(planned.name, ack)
        if self._recorder is not None:
            channel = self._ack_channels.get(planned.name)
            if channel is None:  # declared by the first ack: channels have the order of their first message
                channel = self._channel_number(self._keys.ack(planned.name), AckMessage.ros_type)
                self._ack_channels[planned.name] = channel
            self._unrecorded.append((channel, time_ns, pack_ack(ack) if payload is None else payload))

    def record(self, least: int = 1) -> None:
        """Give the recorder the messages passed on by the step loop, if at least `least`."""
        if self._recorder is not None and len(self._unrecorded) >= least:
            self._recorder.write_all(self._unrecorded)
            self._unrecorded.clear()

    def due_energy_books(self, time_ns: int) -> dict[str, bytes]:
        """Return the energy book of each bond, in CDR, for the recorder; empty unless due."""
        if time_ns < self._next_energy_ns:
            return {}
        self._next_energy_ns = time_ns + _ENERGY_PERIOD_NS
        books = self.energy.encode_books(time_ns)
        if self._recorder is not None:
            for bond, payload in books.items():
                channel = self._channel_number(self._keys.energy(bond), CouplingEnergy.ros_type)
                self._unrecorded.append((channel, time_ns, payload))
        return books

    def status(self, status: SessionStatus) -> None:
        """Record a status of the session, and all earlier messages."""
        if self._recorder is not None:
            channel = self._channel_number(self._keys.status, status.ros_type)
            self._unrecorded.append((channel, status.sim_time_ns, encode(status)))
            self.record()

    def profile(self, profile: Profile) -> None:
        """Record a profile of the session."""
        if self._recorder is not None:
            self._recorder.write(
                self._channel_number(self._keys.profile, profile.ros_type),
                profile.sim_time_ns,
                encode(profile),
            )
