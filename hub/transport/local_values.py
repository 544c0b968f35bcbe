"""Values between the hosts of this machine: a socket for each reading host, past Zenoh.

A value over Zenoh wakes three threads, a value on a socket wakes the stepping thread of the reader. The hub
makes the sockets before the processes, and each process inherits the ends in use: without a name no other
process can connect (docs/decisions/0106-values-over-zenoh.md). Linux only; other hosts have Zenoh.
"""

from __future__ import annotations

import socket
import struct
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from hub.planning.plan import Plan
from hub.transport.host_link import TIME_LIMIT, has_link

__all__ = ["Inboxes", "LocalOutput", "LocalSender", "LocalValues"]

_HEAD = struct.Struct("<H?I")
"""Head of each part of a packet: number of the output, whether the value is complete, and bytes of the part.

A part is a value with its tag, or a piece of a larger value."""
_PACKET = 64 * 2**10
"""Most bytes of a packet: a fraction of a socket's buffer."""
_PART = _PACKET - _HEAD.size


def _outputs_by_reader(plan: Plan) -> dict[str, list[tuple[str, str]]]:
    """Return the outputs read from other hosts of this machine, by reading host, in order of number."""
    found: dict[str, dict[tuple[str, str], None]] = {}
    for connection in plan.connections:
        source, reader = (plan.participants[name].host for name in (connection.source, connection.target))
        if source != reader and all(host == "hub" or has_link(host) for host in (source, reader)):
            found.setdefault(reader, {})[connection.source, connection.source_port] = None
    return {reader: list(outputs) for reader, outputs in found.items()}


class Inboxes:
    """The sockets of a session: both ends of the inbox of each reading host."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._outputs = _outputs_by_reader(plan)
        self._ends: dict[str, tuple[socket.socket, socket.socket]] = {}
        for reader in self._outputs:
            reading, writing = self._ends[reader] = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            reading.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, TIME_LIMIT)
            writing.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, TIME_LIMIT)

    def ends(self, host: str) -> dict[str, socket.socket]:
        """Return the ends used by `host`, by reading host: to read its own inbox, and to write to others."""
        participants = self._plan.participants
        return {
            reader: writing if reader != host else reading
            for reader, (reading, writing) in self._ends.items()
            if reader == host or any(participants[name].host == host for name, _ in self._outputs[reader])
        }

    def close(self) -> None:
        """Close all ends in this process."""
        for ends in self._ends.values():
            for end in ends:
                end.close()


@dataclass
class LocalOutput:
    """An output of another host, as it arrives."""

    values: LocalValues
    arrived: deque[bytes] = field(default_factory=deque[bytes])
    """Values not yet read, each with its tag."""
    parts: list[bytes] = field(default_factory=list[bytes])
    """Parts of an incomplete value."""

    def receive(self, *, wait: bool) -> bytes | None:
        """Return the next value with its tag; None if none has arrived. With `wait`, wait a moment."""
        if not self.arrived:
            if wait:
                self.values.wait()
            else:
                self.values.take_arrived()
        return self.arrived.popleft() if self.arrived else None


class LocalSender:
    """Sends the values of an output to a reading host, with the next `LocalValues.flush`."""

    def __init__(self, outbox: _Outbox, number: int) -> None:
        self._outbox, self._number = outbox, number

    def put(self, payload: bytes, tag: bytes) -> None:
        """Send a value with its tag."""
        self._outbox.put(self._number, tag + payload)


class LocalValues:
    """The values that host `host` of a plan reads from, and sends to, other hosts of this machine.

    `ends` are those of `Inboxes`. Everything is read and written in the stepping thread. A full inbox stops
    its senders, which read their own inboxes meanwhile.
    """

    def __init__(self, plan: Plan, host: str, ends: Mapping[str, socket.socket]) -> None:
        outputs = _outputs_by_reader(plan)
        self._inbox = ends.get(host)
        self._buffer = memoryview(bytearray(_PACKET))
        self._read = {output: LocalOutput(self) for output in outputs.get(host, ())}
        self._by_number = list(self._read.values())
        self._outboxes = {
            reader: _Outbox(self, end, {output: number for number, output in enumerate(outputs[reader])})
            for reader, end in ends.items()
            if reader != host
        }

    def output(self, source: str, port: str) -> LocalOutput | None:
        """Return an output that arrives here; None if it comes another way."""
        return self._read.get((source, port)) if self._inbox is not None else None

    def sender(self, reader: str, source: str, port: str) -> LocalSender | None:
        """Return the sender of an output to host `reader`; None if its values go another way."""
        outbox = self._outboxes.get(reader)
        return None if outbox is None else LocalSender(outbox, outbox.numbers[source, port])

    def flush(self) -> None:
        """Send what was put since the last time: a packet for each reading host."""
        for outbox in self._outboxes.values():
            outbox.flush()

    def take_arrived(self) -> None:
        """Read everything that has arrived."""
        while self._receive(socket.MSG_DONTWAIT):
            pass

    def wait(self) -> None:
        """Read the next packet; wait for it a moment."""
        self._receive(0)

    def _receive(self, flags: int) -> bool:
        if self._inbox is None:
            return False
        try:
            size = self._inbox.recv_into(self._buffer, 0, flags)
        except BlockingIOError:
            return False
        at = 0
        while at < size:
            head: tuple[int, bool, int] = _HEAD.unpack_from(self._buffer, at)
            number, complete, length = head
            at += _HEAD.size + length
            output, part = self._by_number[number], bytes(self._buffer[at - length : at])
            if output.parts or not complete:
                output.parts.append(part)
                if complete:
                    part = b"".join(output.parts)
                    output.parts.clear()
            if complete:
                output.arrived.append(part)
        return size > 0

    def close(self) -> None:
        """Close the sockets."""
        for end in (self._inbox, *(outbox.end for outbox in self._outboxes.values())):
            if end is not None:
                end.close()


class _Outbox:
    """Collects values for the inbox of another host, and sends them in packets."""

    def __init__(
        self, values: LocalValues, end: socket.socket, numbers: Mapping[tuple[str, str], int]
    ) -> None:
        self._values, self.end, self.numbers = values, end, numbers
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, number: int, data: bytes) -> None:
        """Add a value with its tag."""
        for start in range(0, len(data), _PART):
            part = data[start : start + _PART]
            if self._size + _HEAD.size + len(part) > _PACKET:
                self.flush()
            self._parts += _HEAD.pack(number, start + _PART >= len(data), len(part)), part
            self._size += _HEAD.size + len(part)

    def flush(self) -> None:
        """Send what was added; nothing if the reader has ended, which the hub's watchdog reports."""
        if not self._parts:
            return
        packet = b"".join(self._parts)
        self._parts.clear()
        self._size = 0
        with suppress(BrokenPipeError, ConnectionResetError):
            while not self._sent(packet):
                self._values.take_arrived()  # its reader may wait for room in the inbox of this host

    def _sent(self, packet: bytes) -> bool:
        try:
            self.end.send(packet)
        except BlockingIOError:
            return False
        return True
