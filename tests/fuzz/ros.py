"""Mutated bytes of ROS programs where parsers of our own read them: each is accepted, or rejected.

RTPS and its discovery, ROS 1's headers, messages and XML-RPC, the graph of rmw_zenoh, bags.
`python -m tests.fuzz.ros --number 1000 --seed 7 --hours 1`; `--case 7:123` repeats one.
"""

from __future__ import annotations

import random
import socket
import struct
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from functools import cache
from pathlib import Path
from time import monotonic

from devices.ros.dds import rtps
from devices.ros.dds import rtps_discovery as discovery
from devices.ros.dds.services import ServiceParticipant
from devices.ros.ros1.connection import header_frame, parse_header
from devices.ros.ros1.types import Wire
from devices.ros.ros1.xmlrpc_api import ApiClient, ApiServer, success
from devices.ros.topics.dvrk_table import dvrk_table
from devices.ros.topics.row import Row
from devices.ros.topics.validation import as_signal, validate
from devices.ros.zenoh.graph import Graph
from devices.ros.zenoh.layout import VOLATILE, Attachment, GraphToken
from schemas.codec import decode, message_type
from schemas.errors import MessageError, TrocarError
from tests.devices.ros.bags import test_player
from tests.fuzz.byte_mutations import NUMBERS, mutated, mutated_text
from tests.fuzz.harness import Note, Target, search
from tests.fuzz.wire import cdr
from tests.hub.recording import ros_bags as bags
from tests.participants import make_participant

PREFIX = b"\x01\x0f" + b"peer567890"
SERVICE, TYPE = "/PSM1/query_fk", "crtk_msgs/srv/QueryForwardKinematics"
ARMS = {"PSM1": {"instrument": "400006"}}
_CALL = (
    b"<?xml version='1.0'?><methodCall><methodName>publisherUpdate</methodName><params><param><value><string>"
    b"/master</string></value></param><param><value><array><data><value><i4>3</i4></value></data></array>"
    b"</value></param></params></methodCall>"
)
_ANSWER = _CALL.replace(b"methodCall", b"methodResponse").replace(
    b"<methodName>publisherUpdate</methodName>", b""
)


@cache
def _rows() -> list[Row]:
    params = make_participant("ros2-zenoh", "ros", {"arms": ARMS}, Path()).params
    return [row for row in dvrk_table(params) if row.way == "subscribe"]


def _rtps(source: random.Random, _directory: Path) -> str:
    """Send datagrams of a participant: its announcements, and samples of its endpoints."""
    got: list[bytes] = []
    with closing(ServiceParticipant(77, multicast=False, hosts=[])) as participant:
        participant.serve(SERVICE, TYPE, lambda request: request)
        participant.subscribe("/PSM1/hold", "std_msgs/msg/Empty", "", lambda data, _: got.append(data))
        own, labels = participant._guid_prefix, list[str]()
        for part in _parts(source):
            label, datagram = "valid", rtps.encode_message(PREFIX, own, part)
            if source.random() < 0.5:
                label, datagram = mutated(datagram, source)
            labels.append(label)
            try:
                participant._receive(rtps.parse_message(datagram, own), "127.0.0.1")
            except (MessageError, struct.error):  # dropped, as the participant's own thread does
                continue
        participant._maintain(monotonic())
    return " ".join(labels)


def _parts(source: random.Random) -> list[list[bytes]]:
    """Return what is in each datagram, with numbers that may be anything."""
    number = source.choice([1, 2, 3, *NUMBERS, 2**62])
    port = source.choice([7410, 7411, 7411, *NUMBERS])
    ids = [discovery.PUBLICATIONS_WRITER, discovery.SUBSCRIPTIONS_WRITER, b"\0\0\x05\x03", b"\0\0\x06\x04"]
    announced = discovery.participant_data(PREFIX, 77, "127.0.0.1", 7410)
    announced = announced.replace(struct.pack("<I", 7410), struct.pack("<I", port & 0xFFFFFFFF))
    endpoints = [
        discovery.endpoint_data(PREFIX, ids[2], f"rq{SERVICE}Request", "x"),
        discovery.endpoint_data(PREFIX, ids[3], f"rr{SERVICE}Reply", "x"),
        discovery.endpoint_data(PREFIX, ids[2], "rt/PSM1/hold", "x"),
    ]
    reader, writer = source.choice([b"\0\0\x01\x04", b"\0\0\x02\x04", bytes(4)]), source.choice(ids)
    gap = rtps.encode_acknack(writer, reader, number & (2**62), [number + 3], 1)
    every = [
        rtps.encode_data(discovery.SPDP_WRITER, discovery.SPDP_READER, 1, announced),
        rtps.encode_data(ids[0], discovery.PUBLICATIONS_READER, 1, source.choice(endpoints)),
        rtps.encode_data(ids[1], discovery.SUBSCRIPTIONS_READER, 1, source.choice(endpoints)),
        rtps.encode_data(
            writer, reader, number, b"\0\1\0\0" + source.randbytes(30), {0x83: PREFIX + ids[3] * 3}
        ),
        rtps.encode_data(writer, reader, number, b"", {discovery.Pid.STATUS_INFO: b"\0\0\0\3"}),
        rtps.encode_heartbeat(writer, reader, number, source.choice([0, number, 2**62]), 1),
        rtps.encode_acknack(reader, writer, number & (2**62), [number + 3], 1),
        b"\x08" + gap[1:],
    ]
    rest = [source.sample(every, source.choice([1, 2, 4])) for _ in range(source.choice([1, 4, 8]))]
    return [[every[0]], *rest]


def _header(source: random.Random, _directory: Path) -> str:
    label, data = mutated(header_frame({"callerid": "/a", "topic": "/b", "md5sum": "*"})[4:], source)
    parse_header(data)
    return label


def _ros1_message(source: random.Random, _directory: Path) -> str:
    """Read a message of ROS 1 as the gateway does."""
    row = source.choice(_rows())
    label, data = mutated(bytes(Wire(row.type).frame(cdr(row.type, source, wild=False), 1))[4:], source)
    _accept(row, Wire(row.type).cdr(data))
    return label


def _ros2_message(source: random.Random, _directory: Path) -> str:
    row = source.choice(_rows())
    wild = source.random() < 0.5
    label, data = mutated(cdr(row.type, source, wild=wild), source)
    _accept(row, data)
    return label


def _accept(row: Row, data: bytes) -> None:
    message = decode(message_type(row.type), data)
    validate(message, row)
    if row.port is not None and row.port.variability == "signal":
        as_signal(message, row.port)


def _graph(source: random.Random, _directory: Path) -> str:
    """Let programs join and leave, under keys that are none."""
    graph, keys = Graph("own"), list[str]()
    for number in range(source.choice([1, 5])):
        token = GraphToken(
            f"id{number}", number, "MP", "/node", "/PSM1/hold", "std_msgs/msg/Empty", "h", VOLATILE
        )
        label, data = mutated_text(token.key(0).encode(), source)
        keys.append(data.decode("utf-8", "replace"))
        graph.add(keys[-1])
        graph.sender("/PSM1/hold", source.randbytes(16))
    graph.clients(["/PSM1/hold"])
    for key in keys:
        graph.remove(key)
    Attachment.unpack(mutated(Attachment(1, 2, source.randbytes(16)).pack(), source)[1])
    return label


def _xmlrpc_server(source: random.Random, _directory: Path) -> str:
    """Call our node, which has to answer the next call."""
    label, body = mutated_text(_CALL, source)
    head = b"POST / HTTP/1.1\r\nHost: a\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n" % len(body)
    if source.random() < 0.3:
        label, head = mutated_text(head, source)
    with closing(ApiServer("127.0.0.1", {"publisherUpdate": lambda *_: success(1)})) as server:
        address = server.uri.removeprefix("http://").rstrip("/").split(":")
        with socket.create_connection((address[0], int(address[1])), timeout=5.0) as sock:
            sock.settimeout(0.2)
            try:
                sock.sendall(head + body)
                sock.shutdown(socket.SHUT_WR)
                while sock.recv(65536):
                    continue
            except OSError:  # it waits for more, or has closed the connection
                pass
        assert ApiClient(server.uri, "/b").call("publisherUpdate", "/a", []).value == 1
    return label


def _xmlrpc_client(source: random.Random, _directory: Path) -> str:
    """Call a master that answers anything."""
    label, body = mutated_text(_ANSWER, source)
    head = b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n" % len(body)
    if source.random() < 0.3:
        label, head = mutated_text(head, source)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            server.settimeout(5.0)
            try:
                while True:  # the client tries again where the first answer was none
                    sock, _ = server.accept()
                    with sock:
                        sock.recv(65536)
                        sock.sendall(head + body)
            except OSError:
                return

        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        client = ApiClient(f"http://127.0.0.1:{server.getsockname()[1]}/", "/a")
        try:
            client.call("getPid")
        finally:
            client.close()
            server.shutdown(socket.SHUT_RDWR)
            thread.join()
    return label


def _bag(source: random.Random, directory: Path) -> str:
    """Play a bag of ROS 1 or 2."""
    files = sorted(_bags(directory))
    file = source.choice(files)
    spoilt = directory / f"spoilt{file.suffix}"
    label, data = mutated(file.read_bytes(), source, [source.choice(files).read_bytes()])
    spoilt.write_bytes(data)
    device = make_participant(
        "ros-bag", "real", {"bag": str(spoilt), "arms": ARMS, "listen": ["PSM1"]}, directory
    )
    _ = device.ports
    device.open(directory)
    try:
        device.read(10**10)
    finally:
        device.close()
    return f"{file.suffix} {label}"


@cache
def _bags(directory: Path) -> list[Path]:
    if not (directory / "one.bag").exists():
        bags.write1(directory / "one.bag", test_player.SAID)
        bags.write(directory / "mcap", test_player.SAID)
        bags.write(directory / "db3", test_player.SAID, bags.StoragePlugin.SQLITE3)
    return [directory / "one.bag", *(directory / "mcap").glob("*.mcap"), *(directory / "db3").glob("*.db3")]


KINDS: list[Callable[[random.Random, Path], str]] = [
    _rtps,
    _rtps,
    _header,
    _ros1_message,
    _ros2_message,
    _graph,
    _xmlrpc_server,
    _xmlrpc_client,
    _bag,
    _bag,
]


def attempt(case: str, directory: Path, note: Note) -> None:
    """Give the bytes of `case`, SEED:NUMBER, to their reader."""
    source = random.Random(case)
    kind = source.choice(KINDS)
    note(kind.__name__)
    kind(source, directory)


def pristine(directory: Path) -> None:
    """Import and make what all need; read one input of each kind."""
    _bags(directory)
    _rows()
    for number, kind in enumerate(KINDS):
        try:
            kind(random.Random(number), directory)
        except TrocarError:
            continue


def prepare(directory: Path) -> None:
    """Make what all need, without threads, which a forked process has not."""
    _bags(directory)
    _rows()


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, prepare, batch=20), __doc__ or "", hours=0.25))
