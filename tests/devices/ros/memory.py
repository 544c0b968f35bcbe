"""A transport in memory: topics, services and programs without a middleware."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from time import monotonic, sleep
from typing import ClassVar

from devices.ros.gateway import Gateway
from devices.ros.topics.row import Row
from devices.ros.transport import Client, MessageHandler, Publisher, ServiceHandler, Transport
from schemas.codec import decode, encode, message_type
from schemas.message import Message


class MemoryPublisher:
    def __init__(self, transport: MemoryTransport, topic: str) -> None:
        self._transport, self._topic = transport, topic
        self._published = transport.published[topic]

    @property
    def wanted(self) -> bool:
        return self._topic not in self._transport.unwanted

    def __call__(self, message: bytes) -> None:
        self._published.append(message)


class MemoryTransport(Transport):
    def __init__(self) -> None:
        self.published: defaultdict[str, list[bytes]] = defaultdict(list)
        self.unwanted: set[str] = set()
        self.rows: dict[str, Row] = {}
        self.receivers: dict[str, MessageHandler] = {}
        self.handlers: dict[str, ServiceHandler] = {}
        self.connected: tuple[Client, ...] = ()
        self.closed = 0

    def advertise(self, row: Row) -> Publisher:
        self._new(row)
        return MemoryPublisher(self, row.topic)

    def let_go(self, *topics: str) -> None:
        """Unsubscribe all programs from `topics`, and subscribe them to all others."""
        self.unwanted = set(topics)
        self.changed()

    def subscribe(self, row: Row, receive: MessageHandler) -> None:
        self._new(row)
        self.receivers[row.topic] = receive

    def serve(self, row: Row, handle: ServiceHandler) -> None:
        self._new(row)
        self.handlers[row.topic] = handle

    def clients(self) -> tuple[Client, ...]:
        return self.connected

    def close(self) -> None:
        self.closed += 1

    def _new(self, row: Row) -> None:
        assert row.topic not in self.rows, f"{row.topic} twice"
        self.rows[row.topic] = row

    def heard(self, topic: str) -> list[Message]:
        """Return what was published so far."""
        return [
            decode(message_type(self.rows[topic].type), payload) for payload in list(self.published[topic])
        ]

    def send(self, topic: str, message: Message | bytes, client: str = "/console") -> None:
        """Publish as a program would."""
        self.receivers[topic](message if isinstance(message, bytes) else encode(message), client)


class MemoryGateway(Gateway):
    kind: ClassVar[str] = "memory"
    transport: MemoryTransport

    def connect(self, directory: Path) -> Transport:
        self.transport = MemoryTransport()
        return self.transport


class MemoryPeer:
    """A program in memory; see `crtk_table.Peer`."""

    def __init__(self, transport: MemoryTransport, name: str = "/console") -> None:
        self._transport, self._name = transport, name
        self._at: dict[str, int] = {}

    def join(self, rows: Sequence[Row]) -> None:
        for row in rows:
            missed = len(self._transport.published[row.topic])
            self._at[row.topic] = max(missed - 1, 0) if row.latched else missed

    def send(self, row: Row, message: Message) -> None:
        self._transport.send(row.topic, message, self._name)

    def heard(self, row: Row, timeout_s: float) -> Message:
        until = monotonic() + timeout_s
        while len(self._transport.published[row.topic]) <= self._at[row.topic]:
            if monotonic() > until:
                raise TimeoutError(f"nothing on {row.topic}")
            sleep(0.002)
        self._at[row.topic] += 1
        return decode(message_type(row.type), self._transport.published[row.topic][self._at[row.topic] - 1])

    def call(self, row: Row, request: Message) -> Message:
        return decode(
            message_type(f"{row.type}_Response"), self._transport.handlers[row.topic](encode(request))
        )
