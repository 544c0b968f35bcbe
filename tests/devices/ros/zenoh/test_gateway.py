"""The gateway to ROS 2 over Zenoh, on a hub's router, as an independent program sees it."""

import queue
import signal
import struct
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from functools import partial

import numpy as np
import pytest

from devices.ros.zenoh.gateway import ZenohGateway
from hub.transport.zenoh_session import open_session
from schemas.codec import message_type
from schemas.crtk import OperatingState
from schemas.errors import DeviceError
from schemas.ros import StringMessage
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, exercise
from tests.devices.ros.helpers import joint_fields, received, wanted
from tests.devices.ros.zenoh.zenoh_peer import TYPES, Peer, built, flat
from tests.hub.authorities import free_endpoint
from tests.waiting import until

ARM = {"arms": {"PSM1": {}}, "cameras": []}
SETPOINT = "/PSM1/setpoint_js"
STATE, COMMAND, EVENT = "/PSM1/measured_js", "/PSM1/servo_jp", "/PSM1/operating_state"
JOINTS, STATE_TYPE = "sensor_msgs/msg/JointState", "crtk_msgs/msg/OperatingState"


@contextmanager
def router():
    """A hub's router; yields its endpoint."""
    endpoint = free_endpoint()
    with open_session("router", listen=[endpoint]):
        yield endpoint


@contextmanager
def showing(endpoint, directory, **params):
    with ZenohGateway("ros", ZenohGateway.params_model.model_validate(params)) as gateway:
        gateway.learn_hub(partial(open_session, "client", connect=[endpoint]))
        gateway.open(directory)
        with Peer(endpoint, "probe", domain=params.get("domain", 0)) as probe:
            assert until(
                lambda: sum(entry[0] == "dvrk" for entry in probe.graph()) == len(gateway.rows) + 1
            ), "the graph is not complete"
        yield gateway


@pytest.fixture
def hub():
    with router() as endpoint:
        yield endpoint


@pytest.fixture
def psm(hub, tmp_path):
    with showing(hub, tmp_path, **ARM) as gateway:
        yield gateway


@pytest.fixture
def peer(hub):
    with Peer(hub) as it:
        yield it


def joints(values=(0.0,) * 6, stamp_ns=None):
    return built(TYPES, JOINTS, joint_fields(values, stamp_ns))


def complaints(peer):
    """Return a list to which all is added that is said of PSM1."""
    said = []
    for level in ("warning", "error"):
        peer.listen(
            f"/PSM1/{level}",
            "std_msgs/msg/String",
            lambda message, _: said.append(message.data),
            latched=True,
        )
    return said


class TablePeer:
    """A peer as the table's exercise wants it."""

    def __init__(self, peer):
        self.peer, self.published, self.publishers = peer, {}, {}

    def join(self, rows):
        before = {entry[2] for entry in self.peer.graph() if entry[0] == "dvrk" and len(entry) > 2}
        assert {row.topic for row in rows} <= before
        for row in rows:
            if row.way == "publish":
                heard = self.published[row.topic] = queue.Queue()
                self.peer.listen(
                    row.topic,
                    row.type,
                    lambda message, _, heard=heard: heard.put(message),
                    latched=row.latched,
                )
            elif row.way == "subscribe":
                self.publishers[row.topic] = self.peer.publisher(row.topic, row.type)
        time.sleep(0.5)  # until all has gone round

    def send(self, row, message):
        self.publishers[row.topic](built(TYPES, row.type, message.model_dump()))

    def heard(self, row, timeout_s):
        try:
            return message_type(row.type).model_validate(
                flat(self.published[row.topic].get(timeout=timeout_s))
            )
        except queue.Empty:
            raise TimeoutError(row.topic) from None

    def call(self, row, request):
        package, _, name = row.type.split("/")
        response, went, came = self.peer.call(
            row.topic, row.type, built(TYPES, f"{package}/msg/{name}_Request", request.model_dump())
        )
        assert (went[:8], went[16:]) == (came[:8], came[16:])  # sequence number and id come back
        return message_type(f"{row.type}_Response").model_validate(flat(response))


@pytest.mark.long
def test_every_row_of_the_table(hub, tmp_path):
    with showing(hub, tmp_path, **WHOLE) as gateway:
        with Peer(hub) as console:
            table = TablePeer(console)
            table.join(gateway.rows)
            exercise(gateway, table)
        with Peer(hub, "late") as late:
            check_late_joiner(gateway, TablePeer(late))


def test_all_belongs_to_one_node_called_as_on_the_real_system(psm, peer):
    assert until(lambda: {entry[0] for entry in peer.graph()} == {"dvrk", "console"})
    graph = peer.graph()
    ways = {"publish": "MP", "subscribe": "MS", "serve": "SS"}
    assert {entry[1:3] for entry in graph if entry[0] == "dvrk" and entry[1] != "NN"} == {
        (ways[row.way], row.topic) for row in psm.rows
    }
    assert {entry[5] for entry in graph if entry[2:3] == (EVENT,)} == {":1:,1:,:,:,,"}
    assert {entry[5] for entry in graph if entry[2:3] == (STATE,)} == {"::,10:,:,:,,"}


def test_another_domain_is_another_graph(hub, tmp_path):
    with showing(hub, tmp_path, **ARM, domain=42), Peer(hub, domain=42) as there, Peer(hub) as elsewhere:
        assert any(entry[0] == "dvrk" for entry in there.graph())
        assert not any(entry[0] == "dvrk" for entry in elsewhere.graph())


def test_messages_are_numbered_and_carry_the_id_of_their_publisher(psm, peer):
    heard = []
    peer.listen(STATE, JOINTS, lambda _, attached: heard.append(attached))
    psm.write(STATE[1:], np.zeros(18))
    assert until(lambda: len(heard) > 3)
    numbers, stamps, lengths, ids = zip(*heard, strict=True)
    assert list(numbers) == list(range(numbers[0], numbers[0] + len(numbers)))
    assert list(stamps) == sorted(stamps)
    assert (set(lengths), len(set(ids))) == ({16}, 1)


def test_a_state_is_wanted_while_a_program_subscribes(psm, hub):
    assert not wanted(psm, SETPOINT)
    psm.read(0)
    with Peer(hub) as console:
        heard = []
        console.listen(SETPOINT, JOINTS, lambda message, _: heard.append(message))
        assert psm.wait(60.0)
        assert until(lambda: wanted(psm, SETPOINT))
        psm.write(SETPOINT[1:], np.zeros(18))
        assert until(lambda: heard)
        assert not wanted(psm, "/PSM1/measured_cv")
    assert until(lambda: not wanted(psm, SETPOINT))


def test_a_program_that_joins_late_gets_the_last_state_and_no_older_one(psm, hub):
    for state in ("DISABLED", "ENABLED"):
        psm.write(EVENT[1:], OperatingState(state=state))
    with Peer(hub) as late:
        heard, volatile = [], []
        late.listen(EVENT, STATE_TYPE, lambda message, _: heard.append(message.state), latched=True)
        late.listen(EVENT, STATE_TYPE, lambda message, _: volatile.append(message.state))
        assert until(lambda: heard)
        time.sleep(0.7)  # a heartbeat brings it no second time
        assert (heard, volatile) == (["ENABLED"], [])


def test_a_console_that_comes_back_is_there_again(psm, hub):
    for _ in range(3):
        with Peer(hub) as console:
            publish = console.publisher(COMMAND, JOINTS)
            heard = []
            console.listen(STATE, JOINTS, lambda message, _, heard=heard: heard.append(message))
            psm.write(STATE[1:], np.zeros(18))
            assert until(lambda heard=heard: heard)
            publish(joints())
            assert until(lambda: received(psm, COMMAND))
            assert [client.name for client in psm._transport.clients()] == ["/console"]
        assert until(lambda: psm._transport.clients() == ())


def test_the_gateway_is_there_again_when_the_hub_is(tmp_path):
    endpoint = free_endpoint()
    with ExitStack() as stack:
        hub = stack.enter_context(open_session("router", listen=[endpoint]))
        psm = stack.enter_context(showing(endpoint, tmp_path, **ARM))
        hub.close()
        stack.enter_context(open_session("router", listen=[endpoint]))
        console = stack.enter_context(Peer(endpoint))
        heard = []
        console.listen(STATE, JOINTS, lambda message, _: heard.append(message))
        assert until(lambda: psm.write(STATE[1:], np.zeros(18)) or heard)


def test_a_second_console_does_not_command_the_same_arm(psm, hub):
    with Peer(hub, "first") as first, Peer(hub, "second") as second:
        publish, interfere = first.publisher(COMMAND, JOINTS), second.publisher(COMMAND, JOINTS)
        warnings = complaints(second)
        time.sleep(0.3)
        publish(joints([0.1] * 6))
        assert until(lambda: received(psm, COMMAND))
        interfere(joints([0.5] * 6))
        assert until(lambda: warnings)
        assert not received(psm, COMMAND)
        assert "second" in warnings[0] or "publisher" in warnings[0]


NO_MESSAGES = {
    "empty": b"",
    "header": b"\x00\x01\x00\x00",
    "lengths": b"\x00\x01\x00\x00" + b"\xff" * 60,
    "noise": bytes(range(256)) * 16,
}


@pytest.mark.parametrize("payload", NO_MESSAGES.values(), ids=NO_MESSAGES)
def test_bytes_that_are_no_message_move_nothing(psm, peer, payload):
    warnings = complaints(peer)
    publish = peer.publisher(COMMAND, JOINTS)
    time.sleep(0.2)
    publish(raw=payload)
    assert until(lambda: warnings)
    assert not received(psm, COMMAND)


def test_a_message_without_attachment_is_dropped(psm, peer, caplog):
    peer.session.put(peer.key(COMMAND, JOINTS), bytes(TYPES.serialize_cdr(joints(), JOINTS)))
    assert until(lambda: "are no attachment" in caplog.text)
    assert not received(psm, COMMAND)


def test_a_request_that_is_none_gets_an_error(psm, peer):
    key = next(entry for entry in peer.graph() if entry[1:3] == ("SS", "/PSM1/local/forward_kinematics"))
    selector = f"0/PSM1/local/forward_kinematics/{key[3]}/{key[4]}"
    for payload, attachment in ((b"", struct.pack("<qqB", 1, 0, 16) + bytes(16)), (b"\x00\x01\x00\x00", b"")):
        (reply,) = peer.session.get(selector, payload=payload, attachment=attachment, timeout=60.0)
        assert "/PSM1/local/forward_kinematics" in reply.err.payload.to_string()


def test_a_command_that_comes_before_its_token_is_of_its_program(psm, peer):
    """The program has the arm by another publisher already."""
    topic, said = "/PSM1/servo_jr", complaints(peer)
    peer.publisher(COMMAND, JOINTS)(joints([0.1] * 6))
    assert until(lambda: received(psm, COMMAND))
    early = peer.session.declare_publisher(peer.key(topic, JOINTS))
    peer.kept.append(early)
    assert until(lambda: early.matching_status.matching)
    for number in range(2):
        payload = bytes(TYPES.serialize_cdr(joints([0.1 * number] * 6), JOINTS))
        early.put(payload, attachment=struct.pack("<qqB", number, time.time_ns(), 16) + bytes(range(16)))
    peer._token("MP", topic, JOINTS, TYPES.hash_rihs01(JOINTS), latched=False)
    heard = []
    assert until(lambda: heard.extend(received(psm, topic)) or len(heard) == 2)
    assert [sample.message.position[0] for sample in heard] == [0.0, 0.1]
    assert said == []


def test_a_flood_costs_no_other_console_its_states(psm, hub):
    with Peer(hub, "flood") as flood, Peer(hub, "console") as console:
        publish = flood.publisher(COMMAND, JOINTS)
        raw, heard = bytes(TYPES.serialize_cdr(joints(), JOINTS)), []
        console.listen(STATE, JOINTS, lambda message, _: heard.append(message))
        psm.write(STATE[1:], np.zeros(18))
        assert until(lambda: heard)
        for _ in range(20_000):
            publish(raw=raw)
        so_far = len(heard)
        psm.write(STATE[1:], np.zeros(18))
        assert until(lambda: len(heard) > so_far + 5)
        assert len(psm.read(0)) < 20_000


@contextmanager
def stalled(endpoint):
    """A console in a process of its own that listens to everything, and has then stopped reading."""
    command = [sys.executable, "-m", "tests.devices.ros.zenoh.zenoh_peer", endpoint, "0"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGSTOP)
            yield
        finally:
            process.kill()


def test_a_console_that_stops_reading_holds_up_nobody(hub, tmp_path):
    picture = {
        "height": 288,
        "width": 320,
        "encoding": "rgb8",
        "step": 960,
        "data": np.zeros(276480, np.uint8),
    }
    with showing(hub, tmp_path, arms={"PSM1": {}}) as psm, Peer(hub) as console, stalled(hub):
        numbers, words = [], []
        console.listen(STATE, JOINTS, lambda _, attached: numbers.append(attached[0]))
        console.listen(
            "/PSM1/status", "std_msgs/msg/String", lambda message, _: words.append(message.data), latched=True
        )
        image = message_type("sensor_msgs/msg/Image").model_validate(picture)
        assert until(lambda: psm.write("PSM1/status", StringMessage(data="begin")) or words)
        for word in map(str, range(120)):  # 33 MB, more than the buffers on the way to the stalled one hold
            psm.write(STATE[1:], np.zeros(18))
            psm.write("endoscope/left/image_raw", image)
            psm.write("PSM1/status", StringMessage(data=word))
            assert until(lambda word=word: words[-1] == word), "publishing waits for the stalled console"
        assert [word for word in words if word != "begin"] == [str(word) for word in range(120)]
        assert np.diff(numbers).max() == 1, "another console's stop costs this one states"


def test_without_a_hub_it_says_so(tmp_path):
    with pytest.raises(DeviceError, match="without one"):
        ZenohGateway("ros", ZenohGateway.params_model.model_validate(ARM)).open(tmp_path)


def test_keys_that_other_machines_may_use_are_those_of_the_domain():
    keys = ZenohGateway("ros", ZenohGateway.params_model.model_validate({"domain": 7})).foreign_keys
    assert keys == ("7/**", "7/**/@adv/**", "@ros2_lv/7/**")
