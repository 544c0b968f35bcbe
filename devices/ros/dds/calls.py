"""Answers services.

Programs with rmw_fastrtps tell a request from another by parameters beside the message, where Cyclone DDS
lets nobody look.

So it is a participant of its own, of which programs see servers and nothing else. It answers those with
rmw_cyclonedds, too: of two servers a program would take the first that it finds for the one that hears it.
Sources of what a request and its response say beside what is asked: ros2/rmw_fastrtps,
rmw_fastrtps_shared_cpp/src/rmw_request.cpp and rmw_response.cpp; ros2/rmw_cyclonedds,
rmw_cyclonedds_cpp/src/rmw_node.cpp (cdds_request_header_t).
"""

from __future__ import annotations

import logging
import os
import socket
import struct
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from time import monotonic

from devices.ros.dds.lines import Post, Receiving, Sending
from devices.ros.dds.rtps import (
    PL_CDR_LE,
    Acknack,
    Data,
    Gap,
    Heartbeat,
    Received,
    data,
    message,
    parameters,
    read_parameters,
    received,
    sequence_number,
    text,
)
from devices.ros.transport import Handler
from schemas.errors import MessageError

__all__ = ["Calls"]

log = logging.getLogger(__name__)

_FAST_DDS, _CYCLONE_DDS, _NO_VENDOR = b"\x01\x0f", b"\x01\x10", b"\x00\x00"
"""Vendors of a participant, the first two bytes of its id."""
_HEADER = slice(4, 20)
"""Of requests and responses of rmw_cyclonedds, behind the encapsulation header: which client, and the number
of its request.
"""

_PARTICIPANT = b"\x00\x00\x01\xc1"
_FINDER, _FOUND = b"\x00\x01\x00\xc2", b"\x00\x01\x00\xc7"
_PUBLICATIONS, _PUBLICATIONS_HEARD = b"\x00\x00\x03\xc2", b"\x00\x00\x03\xc7"
_SUBSCRIPTIONS, _SUBSCRIPTIONS_HEARD = b"\x00\x00\x04\xc2", b"\x00\x00\x04\xc7"
_WRITER_KIND, _READER_KIND = b"\x03", b"\x04"
"""Ids of built-in readers and writers, and the last byte of others, that have no key: DDSI-RTPS 9.3.1."""

_LEASE, _TOPIC, _TYPE, _DOMAIN, _VERSION, _VENDOR, _RELIABILITY, _DURABILITY = (
    0x02,
    0x05,
    0x07,
    0x0F,
    0x15,
    0x16,
    0x1A,
    0x1D,
)
_UNICAST, _BUILTIN_UNICAST, _PARTICIPANT_ID, _BUILTIN, _ENDPOINT_ID, _KEY_HASH, _STATUS = (
    0x31,
    0x32,
    0x50,
    0x58,
    0x5A,
    0x70,
    0x71,
)
_RELATED, _RELATED_FAST = 0x83, 0x800F
"""Parameters: DDSI-RTPS table 9.13, DDS-RPC 7.8.2; the last is eProsima's own number for the one before."""
_RELIABLE, _VOLATILE = struct.pack("<iiI", 2, 0, 100_000_000), struct.pack("<i", 0)
_GONE = b"\x00\x00\x00\x03"
_ALL_BUILTIN = struct.pack("<I", 0b111111)

_LEASE_S, _PERIOD_S, _REMEMBERED_S = 20.0, 1.0, 3600.0
"""How long a participant that says nothing is taken to be there, how often we say that we are, and how long
the numbers of lines are kept: one that was stopped for longer than its lease, as in a debugger, goes on with
those that it knows.
"""
_FIRST_PORT, _PORTS, _FIRST_OWN, _PER_PARTICIPANT, _MOST_PROGRAMS = 7400, 250, 10, 2, 32
_GROUP = "239.255.0.1"
"""Where programs listen for others: DDSI-RTPS 9.6.2.3."""


@dataclass(frozen=True, slots=True)
class _Service:
    request: str
    response: str
    type: str
    """Of both without `Request_` and `Response_`: `crtk_msgs::srv::dds_::QueryForwardKinematics_`."""
    reader: bytes
    writer: bytes
    handle: Handler


@dataclass(slots=True)
class _Program:
    """A participant of the other side, and all lines to it."""

    builtin: tuple[str, int]
    """Where it listens to what others tell of themselves."""
    address: tuple[str, int]
    """Where it listens to all else."""
    heard_s: float
    receiving: dict[bytes, Receiving] = field(default_factory=dict[bytes, Receiving])
    """By writer."""
    sending: dict[tuple[bytes, bytes], Sending] = field(default_factory=dict[tuple[bytes, bytes], Sending])
    """By writer and reader."""
    early: list[tuple[_Service, Data]] = field(default_factory=list["tuple[_Service, Data]"])
    """Requests of clients that are not known to listen yet."""


_MOST_EARLY = 64


class Calls:
    """Servers of one domain, with a socket and a thread of their own."""

    def __init__(self, domain: int, *, multicast: bool, hosts: Sequence[str]) -> None:
        """Begin to look for programs of a domain: on `hosts`, and on the network if `multicast`.

        Only 127.0.0.1 is heard if nothing else is looked for.
        """
        self._other = b""
        confined = not multicast and all(host == "127.0.0.1" for host in hosts)
        base = _FIRST_PORT + _PORTS * domain
        own_ports = range(
            base + _FIRST_OWN, base + _FIRST_OWN + _PER_PARTICIPANT * (_MOST_PROGRAMS + 1), _PER_PARTICIPANT
        )
        self._targets = [(host, port) for host in hosts for port in own_ports] + (
            [(_GROUP, base)] if multicast else []
        )
        self._domain = domain
        self._prefix = _NO_VENDOR + os.urandom(10)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1" if confined else "", 0))
        self._host = "127.0.0.1" if confined else _own_address()
        self._services: list[_Service] = []
        self._programs: dict[bytes, _Program] = {}
        self._changing = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="DDS services", daemon=True)
        self._thread.start()

    def ignore(self, participant: bytes) -> None:
        """Take the participant with this id, which asks nothing, for nobody: the other one of the same
        gateway.
        """
        with self._changing:
            self._other = participant[:12]
            self._programs.pop(self._other, None)  # found already

    def serve(self, topic: str, ros_type: str, handle: Handler) -> tuple[bytes, bytes]:
        """Begin to answer the service `topic` (`/PSM1/forward_kinematics`) of type `ros_type`
        (`crtk_msgs/srv/QueryForwardKinematics`).

        Returns the ids (16 bytes) of the reader of requests and of the writer of responses.
        """
        package, group, name = ros_type.split("/")
        key = struct.pack(">I", len(self._services) + 1)[1:]
        service = _Service(
            f"rq{topic}Request",
            f"rr{topic}Reply",
            f"{package}::{group}::dds_::{name}_",
            key + _READER_KIND,
            key + _WRITER_KIND,
            handle,
        )
        with self._changing:
            self._services.append(service)
            for program in self._programs.values():
                self._tell(program, service)
        return self._prefix + service.reader, self._prefix + service.writer

    def _run(self) -> None:
        due = monotonic()
        while not self._ended.is_set():
            now = monotonic()
            if now >= due:
                due = now + _PERIOD_S
                self._announce(self._targets)
                self._tidy(now)
            self._socket.settimeout(max(due - monotonic(), 0.001))
            try:
                datagram, address = self._socket.recvfrom(65536)
            except OSError:  # nothing came, or one that we sent to is gone
                continue
            try:
                self._take(received(datagram, self._prefix), address[0])
            except (MessageError, struct.error) as error:
                log.debug("a datagram from %s is not heeded: %s", address[0], error)
            except (
                Exception
            ):  # one that goes wrong in a way nobody thought of is not to leave the others without answers
                log.exception("a datagram from %s makes services fail", address[0])

    def _tidy(self, now: float) -> None:
        with self._changing:
            self._programs = {
                prefix: it for prefix, it in self._programs.items() if now - it.heard_s < _REMEMBERED_S
            }
            for program in self._programs.values():
                if now - program.heard_s < _LEASE_S:
                    for line in program.sending.values():
                        line.repeat()

    def _take(self, got: Received, host: str) -> None:
        if got.source[:2] not in (_FAST_DDS, _CYCLONE_DDS) or got.source == self._other:
            return
        with self._changing:
            for part in got.submessages:
                program = self._programs.get(got.source)
                if isinstance(part, Data) and part.writer == _FINDER:
                    self._found(got.source, part, host)
                elif program is None:
                    continue
                elif isinstance(part, Acknack):
                    if (line := program.sending.get((part.writer, part.reader))) is not None:
                        line.asked(part)
                elif (line := program.receiving.get(part.writer)) is not None:
                    _hand(line, part)

    def _found(self, prefix: bytes, told: Data, host: str) -> None:
        """Take note of a participant that is there, or gone."""
        if _is_gone(told):
            self._programs.pop(prefix, None)
            return
        known = self._programs.get(prefix)
        if known is not None:
            known.heard_s = monotonic()
            return
        builtin, user = (
            (host, struct.unpack_from("<I", _listed(told)[locator], 4)[0])
            for locator in (_BUILTIN_UNICAST, _UNICAST)
        )
        program = self._programs[prefix] = _Program(builtin, user, monotonic())
        post = self._poster(prefix, builtin)
        program.receiving[_PUBLICATIONS] = _line(
            post, prefix, _PUBLICATIONS_HEARD, _PUBLICATIONS, partial(self._publication, prefix)
        )
        program.receiving[_SUBSCRIPTIONS] = _line(
            post, prefix, _SUBSCRIPTIONS_HEARD, _SUBSCRIPTIONS, partial(self._subscription, prefix)
        )
        for writer, reader in ((_PUBLICATIONS, _PUBLICATIONS_HEARD), (_SUBSCRIPTIONS, _SUBSCRIPTIONS_HEARD)):
            program.sending[writer, reader] = Sending(post, writer, reader)
        self._announce([builtin])
        for service in self._services:
            self._tell(program, service)

    def _publication(self, prefix: bytes, told: Data) -> None:
        """Listen to a client's requests, or no more."""
        program = self._programs[prefix]
        if _is_gone(told):
            program.receiving.pop(_identity(told), None)
            return
        listed = _listed(told)
        for service in self._services:
            if listed[_TOPIC].startswith(text(service.request)):
                writer = listed[_ENDPOINT_ID][12:16]
                post = self._poster(prefix, program.address)
                program.receiving[writer] = _line(
                    post, prefix, service.reader, writer, partial(self._asked, service, prefix)
                )

    def _subscription(self, prefix: bytes, told: Data) -> None:
        """Open a line for responses to a client, or close it."""
        program = self._programs[prefix]
        if _is_gone(told):
            gone = _identity(told)
            program.sending = {ids: line for ids, line in program.sending.items() if ids[1] != gone}
            return
        listed = _listed(told)
        for service in self._services:
            if listed[_TOPIC].startswith(text(service.response)):
                reader = listed[_ENDPOINT_ID][12:16]
                program.sending[service.writer, reader] = Sending(
                    self._poster(prefix, program.address), service.writer, reader
                )
        early, program.early = program.early, []
        for service, request in early:
            self._asked(service, prefix, request)

    def _asked(self, service: _Service, prefix: bytes, request: Data) -> None:
        """Answer: to the client that is named beside the request, or to all of the program, of which each
        looks for its header.
        """
        program, payload = self._programs[prefix], request.payload
        if prefix.startswith(_FAST_DDS):
            reader = (request.qos.get(_RELATED) or request.qos.get(_RELATED_FAST) or b"")[:16]
            identity = reader + sequence_number(request.number)
            header, beside = b"", {_RELATED: identity, _RELATED_FAST: identity}
            listening = [
                line for ids, line in program.sending.items() if ids == (service.writer, reader[12:])
            ]
        else:
            header, payload, beside = payload[_HEADER], payload[: _HEADER.start] + payload[_HEADER.stop :], {}
            listening = [line for ids, line in program.sending.items() if ids[0] == service.writer]
        if not listening:
            program.early = [*program.early, (service, request)][-_MOST_EARLY:]
            return
        try:
            response = service.handle(payload)
        except MessageError as error:
            log.warning("%s: a request is not answered: %s", service.request, error)
            return
        for line in listening:
            line.send(response[: _HEADER.start] + header + response[_HEADER.start :], beside)

    def _announce(self, targets: Sequence[tuple[str, int]]) -> None:
        locator = struct.pack("<iI12x4s", 1, self._socket.getsockname()[1], socket.inet_aton(self._host))
        told = {
            _VERSION: b"\x02\x03",
            _VENDOR: _NO_VENDOR,
            _PARTICIPANT_ID: self._prefix + _PARTICIPANT,
            _DOMAIN: struct.pack("<I", self._domain),
            _BUILTIN: _ALL_BUILTIN,
            _BUILTIN_UNICAST: locator,
            _UNICAST: locator,
            _LEASE: struct.pack("<iI", int(_LEASE_S), 0),
        }
        sample = data(_FINDER, _FOUND, 1, PL_CDR_LE + parameters(told))
        self._send(message(self._prefix, bytes(12), [sample]), targets)

    def _tell(self, program: _Program, service: _Service) -> None:
        """Tell a participant of the reader of requests and the writer of responses."""
        both = (
            (
                (_PUBLICATIONS, _PUBLICATIONS_HEARD),
                service.writer,
                service.response,
                f"{service.type}Response_",
            ),
            (
                (_SUBSCRIPTIONS, _SUBSCRIPTIONS_HEARD),
                service.reader,
                service.request,
                f"{service.type}Request_",
            ),
        )
        for line, entity, topic, type_ in both:
            told = {
                _ENDPOINT_ID: self._prefix + entity,
                _PARTICIPANT_ID: self._prefix + _PARTICIPANT,
                _TOPIC: text(topic),
                _TYPE: text(type_),
                _RELIABILITY: _RELIABLE,
                _DURABILITY: _VOLATILE,
            }
            program.sending[line].send(PL_CDR_LE + parameters(told), {})

    def _poster(self, prefix: bytes, address: tuple[str, int]) -> Post:
        return lambda submessages: self._send(message(self._prefix, prefix, submessages), [address])

    def _send(self, datagram: bytes, targets: Sequence[tuple[str, int]]) -> None:
        for target in targets:
            try:
                self._socket.sendto(datagram, target)
            except OSError as error:  # not a reason to stop answering others
                log.debug("nothing can be sent to %s: %s", target, error)

    def close(self) -> None:
        """Leave the domain. May be called twice."""
        if not self._ended.is_set():
            self._ended.set()
            self._thread.join(timeout=2.0)
            gone = data(_FINDER, _FOUND, 2, b"", {_KEY_HASH: self._prefix + _PARTICIPANT, _STATUS: _GONE})
            self._send(
                message(self._prefix, bytes(12), [gone]),
                [program.builtin for program in self._programs.values()],
            )
            self._socket.close()


def _line(post: Post, prefix: bytes, reader: bytes, writer: bytes, take: Callable[[Data], None]) -> Receiving:
    """Return a line from a program's writer that has begun; Cyclone DDS tells by itself what it has, and
    takes the question for malformed.
    """
    line = Receiving(post, reader, writer, take)
    if prefix.startswith(_FAST_DDS):
        line.begin()
    return line


def _hand(line: Receiving, part: Data | Heartbeat | Gap) -> None:
    if isinstance(part, Data):
        line.came(part)
    elif isinstance(part, Heartbeat):
        line.beat(part)
    else:
        line.skip(part)


def _is_gone(told: Data) -> bool:
    return bool(int.from_bytes(told.qos.get(_STATUS, b"")) & _GONE[3])


def _identity(gone: Data) -> bytes:
    """Return the id (4 bytes) of a reader or writer that is gone: Fast DDS tells it beside what it sends,
    Cyclone DDS in it.
    """
    return (gone.qos.get(_KEY_HASH) or read_parameters(gone.payload[4:])[0].get(_ENDPOINT_ID, b""))[12:16]


def _listed(told: Data) -> dict[int, bytes]:
    """Return what a participant tells of itself or of a part of it.

    Raises MessageError if it does not tell enough.
    """
    found, _ = read_parameters(told.payload[4:])
    needed = {_BUILTIN_UNICAST, _UNICAST} if told.writer == _FINDER else {_TOPIC, _ENDPOINT_ID}
    if told.payload[:4] != PL_CDR_LE or needed - found.keys():
        raise MessageError("a participant's description of itself is not complete")
    return found


def _own_address() -> str:
    """Return this machine's address on the network where others are looked for."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((_GROUP, _FIRST_PORT))  # sends nothing
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
