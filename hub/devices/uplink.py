"""A wall-time device's way to the hub and back in one run: its samples out, what the simulation has for it
in, over its link.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from threading import Thread
from time import monotonic_ns

import zenoh
from pydantic import ValidationError
from zenoh.handlers import Callback

from hub.devices.clock_offset import ClockOffset
from hub.devices.device_thread import DeviceThread
from hub.devices.network_link import Line, NetworkLink, NetworkLinkOrder, in_words
from hub.observation.latency import Latencies
from hub.participant import Sample, Value
from hub.planning.plan import ConnectionToDevice, Plan, PlannedParticipant
from hub.transport.bundle import bundled, unpacked
from hub.transport.cells import INITIAL
from hub.transport.envelope import Stamp, Tag
from hub.transport.port_codec import PortCodec
from hub.transport.refusals import Refusals
from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.keys import Keys
from schemas.ports import Port
from schemas.ros import StringMessage
from schemas.trocar_msgs import DeviceStatus

__all__ = ["DeviceUplink", "Run"]

_STATUS_NS = 1_000_000_000
_MOST_WAITING = 8
"""Bundles of signals; a host that is busy beyond that misses the oldest ones, as what it has should be new.
"""


@dataclass(frozen=True)
class Run:
    """The run of a session that a device takes part in."""

    plan: Plan
    keys: Keys
    number: int
    admission: int = 0
    """What the hub has given this host when it let it join; 0 in the hub's own process."""


class DeviceUplink:
    """Publishes what a device says, and writes to it what its connections bring, until it is closed."""

    def __init__(
        self,
        planned: PlannedParticipant,
        run: Run,
        session: zenoh.Session,
        loop: DeviceThread,
        refusals: Refusals,
        offset: ClockOffset | None = None,
    ) -> None:
        """Take the device's loop; `offset` stays away in the hub's own process, whose clock is the hub's."""
        self._member, self._run, self._loop, self._refusals, self._offset = (
            planned,
            run,
            loop,
            refusals,
            offset,
        )
        self._link = NetworkLink(planned.network_link)
        self._latencies = Latencies()
        self._told_ns = -_STATUS_NS
        self._sequence = {port.name: 0 for port in planned.ports}
        outputs = [port for port in planned.ports if port.causality == "output"]
        self._publishers = {
            port.name: _publisher(session, run.keys.output("device", planned.name, port.name), port)
            for port in outputs
        }
        self._lines = {port.name: self._link.line(port) for port in outputs}
        self._status = session.declare_publisher(
            run.keys.device_status(planned.name), encoding=zenoh.Encoding.APPLICATION_CDR
        )
        self._inflows: list[_Inflow] = []
        self._arrived: SimpleQueue[_Subscription | None] = SimpleQueue()
        self._taker = Thread(target=self._take, name=f"inflow {planned.name}", daemon=True)
        self._taker.start()
        self._subscribers = [
            session.declare_subscriber(feed.key, Callback(partial(self._put, feed), indirect=False))
            for feed in self._feeds()
        ]
        self._subscribers.append(
            session.declare_subscriber(
                run.keys.link(planned.name), Callback(self._change_network_link, indirect=True)
            )
        )

    def _feeds(self) -> Iterator[_Subscription]:
        """Yield what is to be listened to: the bundle of each participant's signals, and each event port."""
        plan, keys, name = self._run.plan, self._run.keys, self._member.name
        outlets = [outlet for outlet in plan.to_devices if outlet.target == name]
        for source in dict.fromkeys(outlet.source for outlet in outlets):
            signals = bundled(plan, source, name)
            if signals:
                yield _Subscription(
                    keys.signals(source, name), [self._inflow(outlet) for outlet in signals], whole=False
                )
            for outlet in outlets:
                if outlet.source == source and outlet not in signals:
                    yield _Subscription(
                        keys.feed(source, outlet.source_port), [self._inflow(outlet)], whole=True
                    )

    def _inflow(self, outlet: ConnectionToDevice) -> _Inflow:
        inflow = _Inflow(
            outlet, self._run, self._link, self._loop, self._refusals, self._latencies, self._offset
        )
        self._inflows.append(inflow)
        return inflow

    def _put(self, feed: _Subscription, sample: zenoh.Sample) -> None:
        feed.waiting.append(sample)
        self._arrived.put(feed)

    def _take(self) -> None:
        """Take what arrives, all in one thread: with one for each of a hundred ports the simulation would
        wait for every one of them in turn.
        """
        while (feed := self._arrived.get()) is not None:
            if feed.waiting:  # otherwise newer signals have taken its place
                sample = feed.waiting.popleft()
                try:
                    feed.take(sample, self._run.number)
                except MessageError as error:
                    self._refusals.refuse_sample(sample, error)

    def exchange(self, t: int, samples: list[Sample]) -> bool:
        """Send what the device said at `t` (ns since the loop's start), and hand on what has arrived over the
        link; return whether there is a link.
        """
        self._link.settle(t)
        now_ns, idle = monotonic_ns(), self._link.idle
        for sample in samples:
            number = self._sequence[sample.port] = self._sequence[sample.port] + 1
            stamped = encode(sample.message), Stamp(self._run.admission, number, now_ns).pack()
            if idle:
                self._publish(sample.port, *stamped)
            else:
                self._lines[sample.port].send(t, stamped)
        if not idle:
            for name, line in self._lines.items():
                for _, stamped in line.arrived(t):
                    self._publish(name, *stamped)
            for inflow in self._inflows:
                inflow.arrive(t)
        if now_ns - self._told_ns >= _STATUS_NS:
            self._told_ns = now_ns
            self._status.put(encode(self._report()))
        return not idle

    def _publish(self, port: str, payload: bytes, stamp: bytes) -> None:
        self._publishers[port].put(payload, attachment=stamp)

    def _report(self) -> DeviceStatus:
        best = None if self._offset is None else self._offset.best
        offset_ns, round_trip_ns = (0, -1) if best is None else (best.offset_ns, best.round_trip_ns)
        latencies = self._latencies.messages()
        return DeviceStatus(
            device=self._member.name,
            offset_ns=offset_ns,
            round_trip_ns=round_trip_ns,
            link=in_words(self._link.spec),
            latencies=latencies,
        )

    def _change_network_link(self, sample: zenoh.Sample) -> None:
        try:
            self._link.order(
                NetworkLinkOrder.model_validate_json(decode(StringMessage, sample.payload.to_bytes()).data)
            )
        except (MessageError, ValidationError) as error:
            self._refusals.refuse_sample(sample, error)

    def close(self) -> None:
        """Tell the hub a last time how it was, and send and take no more."""
        self._loop.attach(None)
        self._status.put(encode(self._report()))
        for entity in (*self._subscribers, *self._publishers.values(), self._status):
            entity.undeclare()
        self._arrived.put(None)
        self._taker.join(timeout=2.0)


def _publisher(session: zenoh.Session, key: str, port: Port) -> zenoh.Publisher:
    """Return a publisher of an output: signals go first, and are dropped where the way is choked; events wait
    in a queue of their own.
    """
    if port.variability == "event":
        urgency, choked = zenoh.Priority.INTERACTIVE_HIGH, zenoh.CongestionControl.BLOCK
    else:
        urgency, choked = zenoh.Priority.REAL_TIME, zenoh.CongestionControl.DROP
    return session.declare_publisher(
        key,
        encoding=zenoh.Encoding.APPLICATION_CDR,
        priority=urgency,
        congestion_control=choked,
        express=True,
    )


class _Subscription:
    """What comes under one key."""

    def __init__(self, key: str, inflows: Sequence[_Inflow], *, whole: bool) -> None:
        """`whole`: a message is the value of the only inflow; otherwise it is a bundle."""
        self.key, self._inflows, self._whole = key, inflows, whole
        self.waiting: deque[zenoh.Sample] = deque(maxlen=None if whole else _MOST_WAITING)
        """What has come and is not yet taken."""

    def take(self, sample: zenoh.Sample, run: int) -> None:
        """Hand on what a message holds. Raises MessageError if it is none of this run, or no value."""
        tag = Tag.of(sample)
        if tag.run != run:
            raise MessageError(f"belongs to run {tag.run:x}, this is run {run:x}")
        if not tag.count:  # no events in this step
            return
        payload = sample.payload.to_bytes()
        for index, value in [(0, payload)] if self._whole else unpacked(payload):
            if index >= len(self._inflows):
                raise MessageError(f"a bundle has value {index} of {len(self._inflows)}")
            self._inflows[index].take(tag, value)


class _Inflow:
    """What one connection brings to the device."""

    def __init__(
        self,
        outlet: ConnectionToDevice,
        run: Run,
        link: NetworkLink,
        loop: DeviceThread,
        refusals: Refusals,
        latencies: Latencies,
        offset: ClockOffset | None,
    ) -> None:
        source, target = (
            run.plan.participants[outlet.source],
            run.plan.participants[outlet.target].port(outlet.target_port),
        )
        self._codec = PortCodec(
            source.port(outlet.source_port).model_copy(update={"variability": target.variability})
        )
        self._port, self._stream = (
            target.name,
            f"{outlet.source}.{outlet.source_port} -> {outlet.target}.{target.name}",
        )
        self._link, self._loop, self._refusals, self._latencies, self._offset = (
            link,
            loop,
            refusals,
            latencies,
            offset,
        )
        self._line: Line = link.line(target)
        self._timed = not source.host.startswith("remote/")  # the clock of a third machine is nobody's here
        self._newest = (INITIAL - 1, 0)

    def take(self, tag: Tag, payload: bytes) -> None:
        """Take a value as it comes from the wire. Raises MessageError if it is none."""
        value = self._codec.decode(payload)
        if self._link.idle:
            self._write(tag, value)
        else:
            self._line.send(self._loop.now_ns, (tag, value))

    def arrive(self, t: int) -> None:
        """Write what has arrived over the link by `t` (ns since the loop's start)."""
        for _, (tag, value) in self._line.arrived(t):
            self._write(tag, value)

    def _write(self, tag: Tag, value: Value) -> None:
        if (tag.step, tag.index) <= self._newest:
            if tag.step > INITIAL:  # the value at time 0 is repeated until every host has it
                self._refusals.refuse(
                    self._stream,
                    f"the value of step {tag.step} comes late: that of step {self._newest[0]} was here"
                    " before it",
                )
            return
        self._newest = tag.step, tag.index
        try:
            self._loop.write(self._port, value)
        except MessageError as error:
            self._refusals.refuse(self._stream, error)
            return
        now_ns = monotonic_ns()
        best = None if self._offset is None else self._offset.best
        if self._timed and (self._offset is None or best is not None):
            self._latencies.add(
                "state to force", self._stream, now_ns + (0 if best is None else best.offset_ns) - tag.sent_ns
            )
