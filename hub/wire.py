"""Values on Zenoh: session configuration, the attachment that tags every value, publishers and receivers of ports."""

from __future__ import annotations

import json
import logging
import struct
import threading
from collections.abc import Callable, Mapping, Sequence
from time import monotonic_ns
from typing import Any, NamedTuple

import zenoh
from zenoh.handlers import FifoChannel

from hub.bundle import Bundle
from hub.cells import INITIAL, RemoteCell
from hub.lane import LaneReceiver, LaneSender, has_lane, lane_address
from hub.outgoing import Outgoing
from hub.participant import Value
from hub.plan import Member
from schemas.codec import decode, encode, message_type
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import VectorCodec, has_vector

__all__ = ["Drops", "PortCodec", "PortPublisher", "PortReceiver", "Stamp", "Tag", "Wire", "open_session"]

log = logging.getLogger(__name__)

LEASE_MS = 10_000
"""A peer that is silent for this long is gone. One that dies is known at once, as its sockets close; one on a busy machine may stand for seconds."""

_EVENT_BATCHES = 16
"""Of 64 KiB, for events that wait for their way, Zenoh's most: three pictures. With its default, two, the second picture of a stereo pair was dropped now and
then while the first one was on its way."""

_TAG = struct.Struct("<QIqqHHq")
_STAMP = struct.Struct("<QQq")


def open_session(mode: str, *, listen: Sequence[str] = (), connect: Sequence[str] = (), security: Mapping[str, Any] | None = None) -> zenoh.Session:
    """Open a Zenoh session that scouts for nobody: it listens and connects where it is told to.

    `security`: Zenoh's settings of TLS and of access, as `hub.credentials` and `hub.access` make them.

    Raises ConnectError if an endpoint cannot be opened or reached.
    """
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/timeout_ms": 5000,
        "connect/exit_on_failure": True,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/size/interactive_high": _EVENT_BATCHES,
        "transport/shared_memory/enabled": False,  # its segments outlive a process that is killed
        **(security or {}),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        where = f"listen on {', '.join(listen)}" if listen else f"reach {', '.join(connect)}"
        raise ConnectError(f"cannot {where}: {error}") from error


class Tag:
    """The attachment of every value.

    Run, epoch, step in which it was computed, time it is valid at, index and count of an event batch, and when it was published (by the
    monotonic clock of its host).
    """

    __slots__ = ("count", "epoch", "index", "run", "sent_ns", "step", "time_ns")

    def __init__(self, run: int, epoch: int, step: int, time_ns: int, index: int, count: int, sent_ns: int) -> None:
        self.run, self.epoch, self.step, self.time_ns, self.index, self.count, self.sent_ns = run, epoch, step, time_ns, index, count, sent_ns

    @staticmethod
    def pack(run: int, epoch: int, step: int, time_ns: int, index: int = 0, count: int = 1) -> bytes:
        """Return the bytes of a tag of a value that is published now."""
        return _TAG.pack(run, epoch, step, time_ns, index, count, monotonic_ns())

    @classmethod
    def of(cls, sample: zenoh.Sample) -> Tag:
        """Return the tag of `sample`; raises MessageError if it has none."""
        raw = b"" if sample.attachment is None else sample.attachment.to_bytes()
        if len(raw) != _TAG.size:
            raise MessageError(f"attachment of {len(raw)} bytes, a value's tag has {_TAG.size}")
        return cls(*_TAG.unpack(raw))


class Stamp(NamedTuple):
    """The attachment of every sample of a device."""

    admission: int
    """The hub counts the hosts that it lets join; a device that joined anew begins to count its samples anew."""
    sequence: int
    """Counts the samples of one port."""
    sent_ns: int
    """When the device had it, by the clock of the device: the monotonic clock of its host, or simulated time."""

    def pack(self) -> bytes:
        """Return the bytes of a stamp."""
        return _STAMP.pack(*self)

    @classmethod
    def of(cls, sample: zenoh.Sample) -> Stamp:
        """Return the stamp of `sample`; raises MessageError if it has none."""
        raw = b"" if sample.attachment is None else sample.attachment.to_bytes()
        if len(raw) != _STAMP.size:
            raise MessageError(f"attachment of {len(raw)} bytes, a device's sample has {_STAMP.size}")
        return cls(*_STAMP.unpack(raw))


class Drops:
    """Counts what was refused, per key, and logs each key's first refusals with their source. For use from any thread."""

    _LOGGED_PER_KEY = 3

    def __init__(self, tell: Callable[[str], object] | None = None) -> None:
        """`tell` gets the key of each message that is refused."""
        self.by_key: dict[str, int] = {}
        self._tell = tell
        self._lock = threading.Lock()

    @property
    def total(self) -> int:
        """How many messages were refused."""
        return sum(self.by_key.values())

    def add(self, key: str) -> int:
        """Count one refusal on `key`; return how many there are by now."""
        with self._lock:
            n = self.by_key[key] = self.by_key.get(key, 0) + 1
        if self._tell is not None:
            self._tell(key)
        return n

    def refuse(self, key: str, reason: object, sender: str = "") -> None:
        """Count a refused message, and say why and where it came from."""
        n = self.add(key)
        if n <= self._LOGGED_PER_KEY:
            more = "; further ones on this key are only counted" if n == self._LOGGED_PER_KEY else ""
            log.warning("dropped a message on %s%s: %s%s", key, sender, reason, more)

    def count(self, sample: zenoh.Sample, reason: object) -> None:
        """Refuse a sample."""
        source = sample.source_info
        self.refuse(str(sample.key_expr), reason, f" from {source.source_id.zid}" if source is not None else "")


class PortCodec:
    """Values of one port to CDR and back, whatever its type."""

    def __init__(self, port: Port) -> None:
        self.port = port
        self.is_event = port.variability == "event"
        self.vector = VectorCodec(port) if has_vector(port.type) and not self.is_event else None
        self._model = message_type(port.type)

    def encode(self, value: Any, time_ns: int) -> bytes:
        """Return one vector or message as CDR."""
        return self.vector.encode(value, time_ns) if self.vector is not None else encode(value)

    def decode(self, payload: bytes) -> Any:
        """Return the vector or message in `payload` written by a `PortCodec` of the same port; raises MessageError."""
        return self.vector.decode(payload) if self.vector is not None else decode(self._model, payload)

    def accept(self, payload: bytes) -> Any:
        """Return the vector or message in `payload` written by anybody (joints in any order, frame left out); raises MessageError."""
        if self.vector is not None and self.vector.fits(payload):
            return self.vector.decode(payload)
        message = decode(self._model, payload)
        return self.vector.from_message(message) if self.vector is not None else message

    def batch(self, value: Value) -> tuple[Message, ...]:
        """Return the messages of an event port's value."""
        return value if isinstance(value, tuple) else ()


class PortReceiver:
    """Receives the values of one output port of another process, in order; invalid and foreign messages are dropped and counted."""

    def __init__(self, session: zenoh.Session, key: str, port: Port, run: int, drops: Drops) -> None:
        self._codec = PortCodec(port)
        self._run = run
        self._drops = drops
        self._newest = self._batch_step = INITIAL - 1
        self._batch: tuple[Message, ...] = ()
        self._subscriber = session.declare_subscriber(key, FifoChannel(4096))

    def receive(self) -> tuple[int, Any]:
        """Wait for the next valid value and return it with its tag's step."""
        while True:
            arrived = self._accept(self._subscriber.recv())
            if arrived is not None:
                return arrived

    def poll(self) -> tuple[int, Any] | None:
        """Return the next valid value if one is here."""
        while (sample := self._subscriber.try_recv()) is not None:
            arrived = self._accept(sample)
            if arrived is not None:
                return arrived
        return None

    def _accept(self, sample: zenoh.Sample) -> tuple[int, Any] | None:
        try:
            tag = Tag.of(sample)
            if tag.run != self._run:
                raise MessageError(f"belongs to run {tag.run:x}, this is run {self._run:x}")
            if tag.step <= self._newest:
                if tag.step == INITIAL:
                    return None  # it is sent until every host has it
                raise MessageError(f"the value of step {tag.step} has been here already")
            payload = sample.payload.to_bytes()
            value = self._batched(tag, payload) if self._codec.is_event else self._codec.decode(payload)
        except MessageError as error:
            self._drops.count(sample, error)
            return None
        if value is None:
            return None
        self._newest = tag.step
        return tag.step, value

    def _batched(self, tag: Tag, payload: bytes) -> tuple[Message, ...] | None:
        """Put an event to those of the same step; return them once they are all here."""
        batch = self._batch if tag.step == self._batch_step else ()
        if tag.index != len(batch):
            raise MessageError(f"event {tag.index} of step {tag.step} comes where event {len(batch)} is due")
        events = (self._codec.decode(payload),) if payload or tag.count else ()
        self._batch_step, self._batch = tag.step, (*batch, *events)
        return self._batch if tag.index + 1 >= tag.count else None

    def close(self) -> None:
        """Stop receiving."""
        self._subscriber.undeclare()


class PortPublisher:
    """Publishes the values of one output port; without a reader it costs a flag test.

    Devices of the wall clock hear events under a key of their own, and signals in bundles. A step without events is told only to those who need every
    value (`always`): dozens of quiet ports cost nothing.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        member: Member,
        port: Port,
        run: int,
        *,
        always: bool,
        feeds: bool,
        bundles: Sequence[tuple[Bundle, int]] = (),
        lanes: Sequence[LaneSender] = (),
    ) -> None:
        """`always`: somebody needs every value from the first on; `feeds`: a device of the wall clock takes its events; `bundles`: for its signals."""
        self.codec = PortCodec(port)
        self._lanes = lanes
        self._run = run
        self._always = always
        self._bundles = bundles
        block = zenoh.CongestionControl.BLOCK
        self._ways: list[Outgoing] = []
        self._ways.append(Outgoing(session, keys.output(member.key_role, member.name, port.name), block, self._look, always=always))
        if feeds:
            self._ways.append(Outgoing(session, keys.feed(member.name, port.name), block, self._look, always=False))
        self._look()

    def _look(self) -> None:
        self._wanted = [way for way in self._ways if way.wanted]

    def put(self, step: int, time_ns: int, value: Any) -> None:
        """Publish the value computed in `step`, valid at `time_ns`."""
        for lane in self._lanes:
            lane.send(step, value)
        bundles = [bundle for bundle in self._bundles if bundle[0].wanted] if self._bundles else ()
        if not self._wanted and not bundles:
            return
        if not self.codec.is_event:
            payload = self.codec.encode(value, time_ns)
            for bundle, index in bundles:
                bundle.add(index, payload)
            if self._wanted:
                self._send(payload, Tag.pack(self._run, 0, step, time_ns))
            return
        if not value and self._always:
            self._ways[0].put(b"", Tag.pack(self._run, 0, step, time_ns, 0, 0))
        for index, message in enumerate(value):
            self._send(encode(message), Tag.pack(self._run, 0, step, time_ns, index, len(value)))

    def _send(self, payload: bytes, tag: bytes) -> None:
        for way in self._wanted:
            way.put(payload, tag)

    def close(self) -> None:
        """Stop publishing."""
        for lane in self._lanes:
            lane.close()
        for way in self._ways:
            way.close()


class Wire:
    """A host's publishers and receivers on one Zenoh session, with the fast lanes beside it."""

    def __init__(self, session: zenoh.Session, keys: Keys, run: int, drops: Drops, host: str, *, spin: bool, watched: Sequence[tuple[str, str]] = ()) -> None:
        """Take the session and the name of the host whose values go over it.

        `spin`: its lanes may keep a core busy while they wait; `watched`: the outputs that the hub wants in full.
        """
        self._spin = spin
        self.host = host
        self._watched = set(watched)
        self.session = session
        self.keys = keys
        self.run = run
        self.drops = drops
        self._publishers: list[PortPublisher] = []
        self._bundles: list[Bundle] = []
        self._receivers: list[PortReceiver | LaneReceiver] = []
        self._cells: list[RemoteCell] = []

    def bundle(self, source: str, device: str) -> Bundle:
        """Return what carries the signals of a participant here to a device of the wall clock."""
        bundle = Bundle(self.session, self.keys.signals(source, device))
        self._bundles.append(bundle)
        return bundle

    def publisher(self, member: Member, port: Port, readers: Sequence[str], *, feeds: bool, bundles: Sequence[tuple[Bundle, int]]) -> PortPublisher:
        """Return a publisher of an output of a participant here; the hosts `readers` need every value.

        Devices of the wall clock get events if it `feeds` them, and signals in `bundles`, each with the number that it has there.
        """
        fast = [host for host in readers if has_lane(port, self.host, host)]
        lanes = [LaneSender(lane_address(self.run, member.name, port.name, host)) for host in fast]
        always = len(fast) < len(readers) or (member.name, port.name) in self._watched
        publisher = PortPublisher(self.session, self.keys, member, port, self.run, always=always, feeds=feeds, bundles=bundles, lanes=lanes)
        self._publishers.append(publisher)
        return publisher

    def cell(self, member: Member, port: Port, stride: int, depth: int, heard: Callable[[int, Any], None] | None = None) -> RemoteCell:
        """Return the cell of an output of a participant elsewhere; `heard` is shown each value that comes by a lane."""
        if has_lane(port, member.host, self.host):
            receiver = LaneReceiver(lane_address(self.run, member.name, port.name, self.host), port, spin=self._spin)
        else:
            receiver = PortReceiver(self.session, self.keys.output(member.key_role, member.name, port.name), port, self.run, self.drops)
            heard = None  # whoever watches it subscribes to it
        self._receivers.append(receiver)
        cell = RemoteCell(member.period, stride, depth, receiver, heard)
        self._cells.append(cell)
        return cell

    def linked(self) -> bool:
        """Say whether the initial value of every remote cell has arrived, that is, whether every link works."""
        return all(cell.primed() for cell in self._cells)

    def drain(self) -> None:
        """Take the values that have arrived and nobody has asked for."""
        for cell in self._cells:
            cell.drain()

    def close(self) -> None:
        """Stop publishing and receiving; the session stays open."""
        for entity in (*self._publishers, *self._bundles, *self._receivers):
            entity.close()
        self._publishers, self._bundles, self._receivers = [], [], []
