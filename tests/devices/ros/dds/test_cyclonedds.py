"""The gateway to ROS 2 over DDS, as a program with rmw_cyclonedds sees it: there are no wheels of that, so
one is written here after its sources.

It is on cyclonedds; types and header are written by hand, and share nothing with the gateway's.
"""

import socket
import struct
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from devices.ros.dds import domain as dds_domain
from devices.ros.dds import rtps as dds_rtps
from devices.ros.dds.domain import configuration, domain
from devices.ros.dds.gateway import DdsGateway
from devices.ros.dds.graph import Graph, entities_info
from devices.ros.topics.dvrk_table import dvrk_table
from schemas.errors import DeviceError, MessageError
from tests.devices.ros.rclpy_peer import free_domain
from tests.waiting import until

ARM = {"arms": {"PSM1": {}}, "cameras": []}
RELIABLE = Qos(
    Policy.Reliability.Reliable(0),
    Policy.History.KeepAll,
    Policy.DataRepresentation(use_cdrv0_representation=True),
)


@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    x: types.float64 = 0.0
    y: types.float64 = 0.0
    z: types.float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    x: types.float64 = 0.0
    y: types.float64 = 0.0
    z: types.float64 = 0.0
    w: types.float64 = 1.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class Request(IdlStruct, typename="crtk_msgs.srv.dds_.QueryForwardKinematics_Request_"):
    guid: types.uint64
    seq: types.int64
    jp: types.sequence[types.float64]
    cp: Pose


@dataclass
class Response(IdlStruct, typename="crtk_msgs.srv.dds_.QueryForwardKinematics_Response_"):
    guid: types.uint64
    seq: types.int64
    cp: Pose
    result: bool
    message: str


@dataclass
class Text(IdlStruct, typename="std_msgs.msg.dds_.String_"):
    data: str


def opened(number, directory, name="ros", **params):
    gateway = DdsGateway(name, DdsGateway.params_model.model_validate(ARM | {"domain": number} | params))
    gateway.open(directory)
    return gateway


@pytest.fixture
def gateway(tmp_path):
    with opened(free_domain(), tmp_path) as it:
        yield it


def test_requests_of_rmw_cyclonedds_are_answered_once_with_what_came_before_them(gateway):
    program = DomainParticipant(gateway.params.domain)
    ask = DataWriter(program, Topic(program, "rq/PSM1/local/forward_kinematicsRequest", Request), RELIABLE)
    hear = DataReader(program, Topic(program, "rr/PSM1/local/forward_kinematicsReply", Response), RELIABLE)
    assert until(lambda: ask.get_matched_subscriptions() and hear.get_matched_publications())
    for number in (1, 2):
        ask.write(Request(0xFEED, number, [0.0] * 6, Pose(Point(), Quaternion())))
    heard = []
    assert until(lambda: heard.extend(hear.take(10)) or len(heard) > 1)
    assert [(it.guid, it.seq, it.result) for it in heard] == [(0xFEED, 1, True), (0xFEED, 2, True)]
    time.sleep(0.2)
    assert not hear.take(10)
    program.__del__()


@pytest.mark.parametrize("length", [100, 1_500, 70_000, 1_000_000])
def test_messages_of_any_size_are_received_whole(gateway, length):
    """Cyclone DDS sends what is larger than 1344 bytes in fragments."""
    received = []
    gateway._transport._services.subscribe(
        "/text", "std_msgs/msg/String", "", lambda data, _: received.append(data)
    )
    program = DomainParticipant(gateway.params.domain)
    writer = DataWriter(program, Topic(program, "rt/text", Text), RELIABLE)
    assert until(lambda: writer.get_matched_subscriptions())
    sent = ["ab" * (length // 2), "last"]
    for text in sent:
        writer.write(Text(text))
    assert until(lambda: len(received) == len(sent))
    assert [data[8:].rstrip(b"\0").decode() for data in received] == sent
    program.__del__()


def test_a_datagram_that_goes_wrong_ends_no_service(gateway, caplog):
    services = gateway._transport._services
    torn = dds_rtps.encode_data(b"\x00\x01\x00\xc2", b"\x00\x01\x00\xc7", 1, b"", {0x71: b""})
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for payload in (
            b"",
            b"RTPS",
            dds_rtps.encode_message(b"\x01\x0f" + bytes(10), bytes(12), [torn]),
            bytes(range(256)),
        ):
            other.sendto(payload, ("127.0.0.1", services._socket.port))
    services._receive = lambda *_: 1 / 0
    assert until(lambda: "ZeroDivisionError" in caplog.text), "programs announce themselves every second"
    del services._receive
    assert services._thread.is_alive()


def test_a_peer_that_is_not_known_is_told(tmp_path):
    with pytest.raises(DeviceError, match=r"the peer 'nowhere\.invalid' is not known to this machine"):
        opened(free_domain(), tmp_path, peers=["nowhere.invalid"])


def test_all_is_told_to_be_of_one_node(gateway):
    told = []
    watch = Graph(bytes(16))
    program = DomainParticipant(gateway.params.domain)

    @dataclass
    class Gid(IdlStruct, typename="rmw_dds_common.msg.dds_.Gid_"):
        data: types.array[types.uint8, 16]

    @dataclass
    class Node(IdlStruct, typename="rmw_dds_common.msg.dds_.NodeEntitiesInfo_"):
        node_namespace: types.bounded_str[256]
        node_name: types.bounded_str[256]
        reader_gid_seq: types.sequence[Gid]
        writer_gid_seq: types.sequence[Gid]

    @dataclass
    class Info(IdlStruct, typename="rmw_dds_common.msg.dds_.ParticipantEntitiesInfo_"):
        gid: Gid
        node_entities_info_seq: types.sequence[Node]

    reader = DataReader(
        program, Topic(program, "ros_discovery_info", Info), RELIABLE + Qos(Policy.Durability.TransientLocal)
    )
    assert until(lambda: told.extend(reader.take(100)) or told)
    (node,) = told[-1].node_entities_info_seq
    rows = dvrk_table(gateway.params)
    assert (node.node_namespace, node.node_name) == ("/", "dvrk")
    # a service has one of each
    assert len(node.writer_gid_seq) == sum(row.way != "subscribe" for row in rows)
    assert len(node.reader_gid_seq) == sum(row.way != "publish" for row in rows)
    assert watch.clients({"rt/PSM1/measured_js"}) == ()
    program.__del__()


def test_nothing_but_the_loopback_interface_reaches_it(gateway):
    bound = {}
    for entry in Path("/proc/self/fd").iterdir():
        try:
            it = socket.socket(fileno=int(entry.name))
        except OSError:
            continue
        if it.family == socket.AF_INET and it.type == socket.SOCK_DGRAM:
            host, port = it.getsockname()
            bound[port] = host == "127.0.0.1" or it.getsockopt(
                socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16
            ).startswith(b"lo\0")
        it.detach()
    assert len(bound) > 2
    assert all(bound.values())


def test_opening_and_closing_leaves_no_file_open(tmp_path):
    number = free_domain()
    counts = []
    for _ in range(3):
        opened(number, tmp_path).close()
        counts.append(len(list(Path("/proc/self/fd").iterdir())))
    assert counts[0] == counts[-1]


def test_two_gateways_of_one_process_share_a_domain_if_they_say_the_same(gateway, tmp_path):
    number = gateway.params.domain
    with opened(number, tmp_path, "second", namespace="sim") as second:
        assert {row.topic for row in second.rows} & {"/sim/PSM1/measured_js"}
    with pytest.raises(DeviceError, match="must have the same"):
        opened(number, tmp_path, "third", peers=["192.0.2.9"])


def test_a_gateway_opens_again_where_it_was_closed(tmp_path):
    gateway = opened(number := free_domain(), tmp_path)
    gateway.open(tmp_path)
    gateway.write("PSM1/measured_js", np.zeros(18))
    gateway.close()
    assert free_domain() == number


def test_only_what_was_asked_for_opens_it_to_the_network():
    assert '"127.0.0.1"' in configuration("localhost", ())
    assert "<AllowMulticast>false" in configuration("localhost", ())
    for wider in (configuration("subnet", ()), configuration("localhost", ("console.lab",))):
        assert '"127.0.0.1"' not in wider
    assert '<Peer address="console.lab"/>' in configuration("localhost", ("console.lab",))
    assert "<AllowMulticast>true" in configuration("subnet", ())


def test_it_announces_itself_however_long_no_program_answers():
    assert "<InitialLocatorPruneDelay>inf<" in configuration("localhost", ())


def test_settings_that_make_no_domain_are_told():
    with pytest.raises(DeviceError, match="cannot take part in domain"):
        domain(101, "<CycloneDDS><Domain><General><Nonsense/></General></Domain></CycloneDDS>")


def test_a_system_that_does_not_let_it_keep_to_the_loopback_interface_is_told(monkeypatch):
    def refuse(number):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(dds_domain, "_confine", refuse)
    with pytest.raises(DeviceError, match="bound to the loopback interface"):
        domain(free_domain(), configuration("localhost", ()))


class TestGraph:
    OTHER, THIRD = bytes([1]) * 12 + b"\x00\x00\x01\xc1", bytes([2]) * 12 + b"\x00\x00\x01\xc1"

    def graph(self, *participants):
        graph = Graph(bytes(16))
        for number, participant in enumerate(participants):
            graph.add_endpoint(struct.pack("<QQ", number, 1), participant, "rt/PSM1/servo_jp")
        return graph

    def test_a_program_is_called_like_its_first_node(self):
        graph = self.graph(self.OTHER, self.THIRD)
        for participant in (self.OTHER, self.THIRD):
            graph.set_nodes(entities_info(participant, "/lab/console", [], [bytes(16)]))
        assert graph.sender(self.OTHER) == "/lab/console"
        assert graph.sender(self.THIRD) == f"/lab/console ({self.THIRD[:12].hex()})"
        assert [client.name for client in graph.clients({"rt/PSM1/servo_jp"})] == [
            graph.sender(self.OTHER),
            graph.sender(self.THIRD),
        ]
        assert graph.clients({"rt/elsewhere"}) == ()

    def test_who_has_sent_something_keeps_its_name(self):
        graph = self.graph(self.OTHER)
        before = graph.sender(self.OTHER)
        graph.set_nodes(entities_info(self.OTHER, "/console", [], []))
        assert graph.sender(self.OTHER) == before
        graph.remove_endpoint(struct.pack("<QQ", 0, 1))
        assert graph.clients({"rt/PSM1/servo_jp"}) == ()

    def test_who_counts_as_gone_for_a_while_and_goes_on_keeps_its_name(self):
        # it leads an arm: under another name its own commands would be refused in favour of itself
        graph = self.graph(self.OTHER)
        before = graph.sender(self.OTHER)
        graph.remove_endpoint(struct.pack("<QQ", 0, 1))
        graph.add_endpoint(struct.pack("<QQ", 0, 1), self.OTHER, "rt/PSM1/servo_jp")
        graph.set_nodes(entities_info(self.OTHER, "/console", [], []))
        assert graph.sender(self.OTHER) == before

    def test_a_program_that_is_started_again_has_its_name_again(self):
        graph = self.graph(self.OTHER)
        graph.set_nodes(entities_info(self.OTHER, "/console", [], []))
        assert graph.sender(self.OTHER) == "/console"
        graph.remove_endpoint(struct.pack("<QQ", 0, 1))
        graph.add_endpoint(struct.pack("<QQ", 1, 1), self.THIRD, "rt/PSM1/servo_jp")
        graph.set_nodes(entities_info(self.THIRD, "/console", [], []))
        assert graph.sender(self.THIRD) == "/console"

    def test_names_of_programs_that_are_gone_are_not_kept_without_limit(self):
        graph = self.graph(self.OTHER)
        graph.sender(self.OTHER)
        graph.set_nodes(entities_info(self.OTHER, "/console", [], []))
        for number in range(1000):
            graph.sender(struct.pack("<QQ", number, 1))
        assert graph.sender(self.OTHER) == "/console", "its first name is forgotten"

    def test_bytes_that_are_no_such_message_are_refused(self):
        with pytest.raises(MessageError, match="ParticipantEntitiesInfo"):
            self.graph().set_nodes(b"\x00\x01\x00\x00\xff")
