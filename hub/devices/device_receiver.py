"""Receives the simulation's messages to a wall-time device, and writes the values to the device."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from queue import SimpleQueue
from threading import Thread
from time import monotonic_ns

import zenoh
from zenoh.handlers import Callback

from hub.devices.clock_offset import ClockOffset
from hub.devices.device_thread import DeviceThread
from hub.devices.network_link import NetworkLink
from hub.observation.latency import Latencies
from hub.participant import Value
from hub.planning.plan import ConnectionToDevice
from hub.transport.bundle import bundled_connections, unpack_bundle, use_mask
from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.port_codec import PortCodec
from hub.transport.run_connection import RunConnection
from schemas.errors import MessageError

__all__ = ["DeviceReceiver"]

_MOST_WAITING = 8
"""Bundles of signals: a host busy for longer misses the oldest, as values should be new."""


class DeviceReceiver:
    """Receives the messages of the connections to a device, until closed.

    All in a single thread: with a thread for each of a hundred ports, the simulation would wait for each in
    turn.
    """

    def __init__(
        self,
        name: str,
        run: RunConnection,
        link: NetworkLink,
        thread: DeviceThread,
        offset: ClockOffset | None,
    ) -> None:
        self.latencies = Latencies()
        """Latencies from a value to the device."""
        self._name, self._run, self._link, self._device, self._offset = name, run, link, thread, offset
        self._inputs: list[_Input] = []
        self._unused: Collection[str] = ()
        self._has_reported = False
        """Whether the sources know `_unused`: of most devices everything is used."""
        self._uses: list[tuple[list[str], zenoh.Publisher]] = []
        """Inputs of each bundle, and the publisher of the inputs in use."""
        self._arrived: SimpleQueue[_Subscription | None] = SimpleQueue()
        self._thread = Thread(target=self._receive, name=f"receiver {name}", daemon=True)
        self._thread.start()
        self._subscribers = [
            run.session.declare_subscriber(one.key, Callback(partial(self._put, one), indirect=False))
            for one in self._create_subscriptions()
        ]

    def _create_subscriptions(self) -> Iterator[_Subscription]:
        """Yield the keys to receive: the bundle of each participant's signals, and each event port."""
        plan, keys, name = self._run.plan, self._run.keys, self._name
        outlets = [outlet for outlet in plan.to_devices if outlet.target == name]
        for source in dict.fromkeys(outlet.source for outlet in outlets):
            signals = bundled_connections(plan, source, name)
            if signals:
                inputs = [self._create_input(outlet) for outlet in signals]
                uses = self._run.session.declare_publisher(keys.uses(name, source), express=True)
                self._uses.append(([outlet.target_port for outlet in signals], uses))
                yield _Subscription(keys.signals(source, name), inputs, whole=False)
            for outlet in outlets:
                if outlet.source == source and outlet not in signals:
                    key = keys.feed(source, outlet.source_port)
                    yield _Subscription(key, [self._create_input(outlet)], whole=True)

    def _create_input(self, outlet: ConnectionToDevice) -> _Input:
        made = _Input(outlet, self._run, self._link, self._device, self.latencies, self._offset)
        self._inputs.append(made)
        return made

    def _put(self, subscription: _Subscription, sample: zenoh.Sample) -> None:
        subscription.waiting.append(sample)
        self._arrived.put(subscription)

    def _receive(self) -> None:
        while (subscription := self._arrived.get()) is not None:
            if subscription.waiting:  # otherwise newer signals have taken its place
                sample = subscription.waiting.popleft()
                try:
                    subscription.receive(sample, self._run)
                except MessageError as error:
                    self._run.refusals.refuse_sample(sample, error)

    def want_all_but(self, unused: Collection[str], *, again: bool = False) -> None:
        """Tell the sources the signals not needed, after a change or on `again`."""
        if unused is self._unused and not (again and self._has_reported):
            return
        self._unused, self._has_reported = unused, True
        for ports, publisher in self._uses:
            publisher.put(use_mask(ports, unused), attachment=Tag.pack(self._run.number, 0, INITIAL, 0))

    def write_arrived(self, t: int) -> None:
        """Write to the device the values past the link by `t` (ns since the start of the device's thread)."""
        for one in self._inputs:
            one.write_arrived(t)

    def close(self) -> None:
        """Receive no more."""
        for subscriber in self._subscribers:
            subscriber.undeclare()
        for _, publisher in self._uses:
            publisher.undeclare()
        self._arrived.put(None)
        self._thread.join(timeout=2.0)


class _Subscription:
    """The messages of a key, and the receiving inputs.

    `whole`: a message is the value of the only input; otherwise the message is a bundle.
    """

    def __init__(self, key: str, inputs: Sequence[_Input], *, whole: bool) -> None:
        self.key, self._inputs, self._whole = key, inputs, whole
        self.waiting: deque[zenoh.Sample] = deque(maxlen=None if whole else _MOST_WAITING)
        """Messages received but not yet handled."""

    def receive(self, sample: zenoh.Sample, run: RunConnection) -> None:
        """Give a message's values to the inputs; raises MessageError if invalid or of another run."""
        tag = Tag.of(sample)
        if tag.run != run.number:
            raise MessageError(f"belongs to run {tag.run:x}, this is run {run.number:x}")
        if not tag.count:  # no events in this step
            return
        if tag.step > INITIAL and tag.time_ns < run.live_from_ns:
            return
        payload = sample.payload.to_bytes()
        if self._whole:
            self._inputs[0].receive(tag, payload)
            return
        for index, value in unpack_bundle(payload):
            if index >= len(self._inputs):
                raise MessageError(f"a bundle has value {index} of {len(self._inputs)}")
            self._inputs[index].receive_packed(tag, value)


class _Input:
    """A connection to the device."""

    def __init__(
        self,
        outlet: ConnectionToDevice,
        run: RunConnection,
        link: NetworkLink,
        thread: DeviceThread,
        latencies: Latencies,
        offset: ClockOffset | None,
    ) -> None:
        source = run.plan.participants[outlet.source]
        target = run.plan.participants[outlet.target].port(outlet.target_port)
        sent = source.port(outlet.source_port)
        self._codec = PortCodec(sent)
        self._as_messages = target.variability == "event"
        self._port = target.name
        self._stream = f"{outlet.source}.{outlet.source_port} -> {outlet.target}.{target.name}"
        self._link, self._line = link, link.line(target)
        self._device, self._refusals, self._latencies, self._offset = thread, run.refusals, latencies, offset
        self._timed = not source.host.startswith("remote/")  # the clock of a third machine is not known here
        self._newest = (INITIAL - 1, 0)

    def receive(self, tag: Tag, payload: bytes) -> None:
        """Write a value (CDR), or send it over the link; raises MessageError for an invalid value."""
        self._accept_value(tag, self._codec.decode(payload))

    def receive_packed(self, tag: Tag, packed: bytes) -> None:
        """Write a value of a bundle, or send it over the link; raises MessageError for an invalid value."""
        value = self._codec.unpack(packed)
        if self._as_messages and self._codec.vector is not None:
            value = self._codec.vector.to_message(value, tag.time_ns)
        self._accept_value(tag, value)

    def _accept_value(self, tag: Tag, value: Value) -> None:
        if self._link.idle:
            self._write(tag, value)
        else:
            self._line.send(self._device.now_ns, (tag, value))

    def write_arrived(self, t: int) -> None:
        """Write the values past the link by `t` (ns since the start of the device's thread)."""
        for _, (tag, value) in self._line.pop_arrivals(t):
            self._write(tag, value)

    def _write(self, tag: Tag, value: Value) -> None:
        if (tag.step, tag.index) <= self._newest:
            if tag.step > INITIAL:  # the value at time 0 is repeated until every host has it
                self._refusals.refuse(
                    self._stream,
                    f"the value of step {tag.step} is late: that of step {self._newest[0]} arrived before it",
                )
            return
        self._newest = tag.step, tag.index
        try:
            self._device.write(self._port, value)
        except MessageError as error:
            self._refusals.refuse(self._stream, error)
            return
        best = None if self._offset is None else self._offset.best
        if self._timed and (self._offset is None or best is not None):
            now_ns = monotonic_ns() + (0 if best is None else best.offset_ns)
            self._latencies.add("state to force", self._stream, now_ns - tag.sent_ns)
