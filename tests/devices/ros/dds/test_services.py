"""The participant of services and subscriptions, against datagrams of programs of any kind."""

import socket
import struct
import threading
from contextlib import closing, suppress
from time import monotonic

import pytest

from devices.ros.dds.rtps import AckNack, Data, encode_acknack, encode_data, encode_message, parse_message
from devices.ros.dds.rtps_discovery import (
    MULTICAST_GROUP,
    PARTICIPANT,
    SPDP_READER,
    SPDP_WRITER,
    SUBSCRIPTIONS_READER,
    SUBSCRIPTIONS_WRITER,
    multicast_port,
    participant_data,
    unicast_ports,
)
from devices.ros.dds.services import ServiceParticipant
from schemas.errors import MessageError
from tests.waiting import LIMIT_S

PATIENCE_S = LIMIT_S


def announcement(peer: bytes, port: int) -> bytes:
    """Return the datagram with which the participant `peer` announces that it receives at `port`."""
    locator = struct.pack("<I", 7)
    payload = participant_data(peer, 77, "127.0.0.1", 7).replace(locator, struct.pack("<I", port))
    return encode_message(peer, bytes(12), [encode_data(SPDP_WRITER, SPDP_READER, 1, payload)])


@pytest.mark.parametrize("port", [0, 65536, 2**32 - 1])
def test_an_address_that_is_none_does_not_end_the_services_of_other_programs(port: int) -> None:
    with (
        closing(ServiceParticipant(77, multicast=False, hosts=[])) as services,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
    ):
        services.subscribe("/PSM1/hold", "std_msgs/msg/Empty", "", lambda _data, _sender: None)
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(PATIENCE_S)
        ours = ("127.0.0.1", services._socket.port)
        peer.sendto(announcement(b"\x01\x0fwrong67890", port), ours)
        ended = monotonic() + 1.5  # longer than the period at which heartbeats are sent
        while monotonic() < ended and services._thread.is_alive():
            threading.Event().wait(0.05)
        peer.sendto(announcement(b"\x01\x0fright67890", peer.getsockname()[1]), ours)
        assert peer.recv(65536).startswith(b"RTPS")


def heard_by(peer: socket.socket, prefix: bytes) -> tuple[bytes, tuple[AckNack | Data, ...]]:
    """Return the sender and the submessages of the next datagram."""
    message = parse_message(peer.recv(65536), prefix)
    return message.guid_prefix, message.submessages


@pytest.mark.parametrize("way", ["port", "multicast"])
def test_a_program_that_announces_itself_is_told_of_both_participants_at_once(way: str) -> None:
    """Before the next announcement to all, for a program may look for its peers once."""
    cyclone, program = b"\x01\x10gateway890", b"\x01\x0fprogram890"
    with (
        closing(ServiceParticipant(76, multicast=False, hosts=[])) as services,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
    ):
        assert services._socket.port in unicast_ports(76)
        services.ignore(cyclone + PARTICIPANT)
        ours = ("127.0.0.1", services._socket.port)
        if way == "multicast":
            peer.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
            ours = (MULTICAST_GROUP, multicast_port(76))
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(PATIENCE_S)
        peer.sendto(announcement(cyclone, 7), ours)
        peer.sendto(announcement(program, peer.getsockname()[1]), ours)
        announced = [
            sender
            for sender, parts in (heard_by(peer, program) for _ in range(4))
            if any(isinstance(part, Data) and part.writer_id == SPDP_WRITER for part in parts)
        ]
        assert announced == [services._guid_prefix, cyclone]


def test_a_program_that_was_not_listening_yet_gets_all_subscriptions() -> None:
    program = b"\x01\x0fprogram890"
    with (
        closing(ServiceParticipant(76, multicast=False, hosts=[])) as services,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer,
    ):
        for number in range(150):
            services.subscribe(f"/PSM1/hold{number}", "std_msgs/msg/Empty", "", lambda _data, _sender: None)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(PATIENCE_S)
        peer.sendto(announcement(program, peer.getsockname()[1]), ("127.0.0.1", services._socket.port))
        first = {it.sequence_number for it in subscriptions(peer, program, 150)}
        missing = range(1, 151)
        wanted = encode_acknack(SUBSCRIPTIONS_WRITER, SUBSCRIPTIONS_READER, 1, missing, 1)
        peer.sendto(encode_message(program, bytes(12), [wanted]), ("127.0.0.1", services._socket.port))
        again = {it.sequence_number for it in subscriptions(peer, program, 150)}
        assert first == again == set(missing)


def subscriptions(peer: socket.socket, prefix: bytes, count: int) -> list[Data]:
    """Return the next announcements of subscriptions."""
    found: list[Data] = []
    while len(found) < count:
        parts = heard_by(peer, prefix)[1]
        found += [it for it in parts if isinstance(it, Data) and it.writer_id == SUBSCRIPTIONS_WRITER]
    return found


def test_what_is_remembered_of_a_domain_is_limited() -> None:
    with closing(ServiceParticipant(77, multicast=False, hosts=[])) as services:
        for number in range(600):
            peer = b"\x01\x0f" + number.to_bytes(10, "big")
            with suppress(MessageError):
                services._receive(parse_message(announcement(peer, 9), services._guid_prefix), "127.0.0.1")
        assert len(services._matching.proxies) == 512
