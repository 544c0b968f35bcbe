"""The participant of services and subscriptions, against datagrams of programs of any kind."""

import socket
import struct
import threading
from contextlib import closing, suppress
from time import monotonic

import pytest

from devices.ros.dds.rtps import encode_data, encode_message, parse_message
from devices.ros.dds.rtps_discovery import SPDP_READER, SPDP_WRITER, participant_data
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


def test_what_is_remembered_of_a_domain_is_limited() -> None:
    with closing(ServiceParticipant(77, multicast=False, hosts=[])) as services:
        for number in range(600):
            peer = b"\x01\x0f" + number.to_bytes(10, "big")
            with suppress(MessageError):
                services._receive(parse_message(announcement(peer, 9), services._guid_prefix), "127.0.0.1")
        assert len(services._matching.proxies) == 512
