"""The gateway to ROS 2 over DDS, as real rclpy sees it."""

import signal
import subprocess
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from cyclonedds.qos import Policy

from devices.ros.dds.gateway import DdsGateway
from schemas.codec import message_type, rihs01
from schemas.ros import Header, JointState, StringMessage, Time
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, exercise
from tests.devices.ros.helpers import received, wanted
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rclpy_peer import RclpyPeer, environment, free_domain
from tests.waiting import LIMIT_S, until

__all__ = ["rclpy_python"]

STATE, COMMAND, EVENT, STATUS, WARNING = (
    f"/PSM1/{name}" for name in ("measured_js", "servo_jp", "operating_state", "status", "warning")
)
FIRST_COMMAND = Path(__file__).parent / "rclpy_first_command.py"
ARM = {"arms": {"PSM1": {}}, "cameras": []}


@pytest.fixture
def domain():
    return free_domain()


@contextmanager
def showing(directory, **params):
    with DdsGateway("ros", DdsGateway.params_model.model_validate(params)) as gateway:
        gateway.open(directory)
        yield gateway


class Console(RclpyPeer):
    """A program that waits until the gateway has discovered it: it gets nothing from before that."""

    def __init__(self, python, gateway, name="console", **settings):
        super().__init__(python, gateway.params.domain, name, **settings)
        self.gateway, self.name = gateway, name

    def join(self, rows):
        super().join(rows)
        topics, transport = {f"rt{row.topic}" for row in rows if row.way != "serve"}, self.gateway._transport
        found = [it.get_publication_matched_status for it in transport._writers if it.topic.name in topics]
        assert until(lambda: all(status().current_count for status in found))
        commands = {f"rt{row.topic}" for row in rows if row.way == "subscribe"}
        assert until(lambda: commands <= transport._services.matched_topics())
        assert until(lambda: any(client.name == f"/{self.name}" for client in transport.clients())), (
            "the gateway does not know its name"
        )


def test_every_row_of_the_table(rclpy_python, domain, tmp_path):
    with showing(tmp_path, **WHOLE, domain=domain) as gateway:
        with Console(rclpy_python, gateway) as console:
            console.join(gateway.rows)
            exercise(gateway, console)
        with Console(rclpy_python, gateway, "late") as late:
            check_late_joiner(gateway, late)


def row(gateway, topic):
    return next(row for row in gateway.rows if row.topic == topic)


@pytest.fixture
def psm(domain, tmp_path):
    with showing(tmp_path, **ARM, domain=domain) as gateway:
        yield gateway


@contextmanager
def console(python, gateway, *topics, **settings):
    """A program with these topics."""
    with Console(python, gateway, **settings) as it:
        it.join([row(gateway, topic) for topic in topics])
        yield it


def joints(values=(0.0,) * 6):
    return JointState(header=Header(stamp=Time.from_ns(time.time_ns())), position=np.array(values))


def test_all_belongs_to_one_node_called_as_on_the_real_system(rclpy_python, psm):
    with console(rclpy_python, psm, STATE, EVENT, COMMAND) as program:
        assert until(lambda: sorted(program.do("nodes")) == ["/console", "/console_asking", "/dvrk"])
        for topic, durability in ((STATE, "VOLATILE"), (EVENT, "TRANSIENT_LOCAL")):
            offers = [offer[1:] for offer in program.do("offered", topic=topic) if offer[0] == "dvrk"]
            type_ = row(psm, topic).type
            assert offers == [[type_, rihs01(type_), durability, "RELIABLE"]]
        assert until(lambda: [client.name for client in psm._transport.clients()] == ["/console"]), (
            psm._transport.clients()
        )


def test_a_state_is_wanted_while_a_program_subscribes(rclpy_python, psm):
    topic = "/PSM1/setpoint_js"
    assert not wanted(psm, topic)
    psm.read(0)
    with console(rclpy_python, psm, topic):
        assert psm.wait(60.0)
        assert until(lambda: wanted(psm, topic))
        assert not wanted(psm, "/PSM1/measured_cv")
    assert until(lambda: not wanted(psm, topic))


def test_a_program_with_the_default_range_finds_it(rclpy_python, psm):
    with console(rclpy_python, psm, COMMAND, STATE, discovery="SUBNET") as program:
        program.send(row(psm, COMMAND), joints())
        assert until(lambda: received(psm, COMMAND))
        psm.write(STATE[1:], np.zeros(18))
        assert program.heard(row(psm, STATE), 60.0)


def test_another_domain_is_another_graph(rclpy_python, psm):
    with RclpyPeer(rclpy_python, free_domain()) as program:
        assert program.do("join", rows=[(STATE, row(psm, STATE).type, "publish", False)], timeout=1.5) == [
            STATE
        ]


def test_a_console_that_comes_back_is_there_again(rclpy_python, psm):
    for _ in range(2):
        with console(rclpy_python, psm, STATE, COMMAND) as program:
            psm.write(STATE[1:], np.zeros(18))
            assert program.heard(row(psm, STATE), 60.0)
            program.send(row(psm, COMMAND), joints())
            assert until(lambda: received(psm, COMMAND))
        assert until(lambda: psm._transport.clients() == ()), psm._transport.clients()


def test_a_second_console_does_not_command_the_same_arm(rclpy_python, psm):
    with (
        console(rclpy_python, psm, COMMAND, name="first") as first,
        console(rclpy_python, psm, COMMAND, WARNING, name="second") as second,
    ):
        first.send(row(psm, COMMAND), joints([0.1] * 6))
        assert until(lambda: received(psm, COMMAND))
        second.send(row(psm, COMMAND), joints([0.5] * 6))
        assert "/second" in second.heard(row(psm, WARNING), 60.0).data
        assert not received(psm, COMMAND)


def test_bytes_that_are_no_message_move_nothing(rclpy_python, psm):
    with console(rclpy_python, psm, COMMAND) as program:
        for payload in (b"\x00\x01\x00\x00", b"\x00\x01\x00\x00" + b"\xff" * 60, bytes(range(256)) * 16):
            program.do("send_raw", topic=COMMAND, payload=payload.hex())
        program.send(row(psm, COMMAND), joints([0.25] * 6))
        heard = []
        assert until(lambda: heard.extend(received(psm, COMMAND)) or heard)
        assert [sample.message.position.tolist() for sample in heard] == [[0.25] * 6]


def test_a_flood_costs_no_other_console_its_states(rclpy_python, psm):
    with (
        console(rclpy_python, psm, COMMAND, name="flood") as flood,
        console(rclpy_python, psm, STATE) as program,
    ):
        flood.send(row(psm, COMMAND), joints(), times=20_000)
        psm.write(STATE[1:], np.zeros(18))
        for _ in range(20):
            assert program.heard(row(psm, STATE), 60.0)
        assert 0 < len(received(psm, COMMAND)) < 20_000


@pytest.mark.parametrize(("kind", "length"), [("latched", 6), ("once", 6), ("once", 200_000)])
def test_the_first_command_of_a_program_is_received_once(rclpy_python, psm, kind, length):
    """One above 64 kB arrives in fragments."""
    count = 4 if length == 6 else 2
    command = [rclpy_python, FIRST_COMMAND, "/PSM1/state_command", kind, str(count), str(length)]
    with subprocess.Popen(command, env=environment(psm.params.domain)) as programs:
        try:
            programs.wait(timeout=LIMIT_S)
        finally:
            programs.kill()
    heard = [sample.message for sample in received(psm, "/PSM1/state_command")]
    assert [message.header.frame_id for message in heard] == [f"{kind}{number}" for number in range(count)]
    assert {message.string for message in heard} == {"enable".ljust(length)}


def test_a_console_that_stops_reading_holds_up_nobody(rclpy_python, domain, tmp_path):
    picture = {
        "height": 288,
        "width": 320,
        "encoding": "rgb8",
        "step": 960,
        "data": np.zeros(276480, np.uint8),
    }
    image = message_type("sensor_msgs/msg/Image").model_validate(picture)
    with (
        showing(tmp_path, arms={"PSM1": {}}, domain=domain) as gateway,
        console(rclpy_python, gateway, STATE, STATUS) as program,
        ExitStack() as stack,
    ):
        stalled = stack.enter_context(Console(rclpy_python, gateway, "stalled"))
        stalled.join(gateway.rows)
        never_blocks = Policy.Reliability.Reliable(0)
        assert all(never_blocks in writer.get_qos() for writer in gateway._transport._writers)
        stalled.process.send_signal(signal.SIGSTOP)
        for word in range(120):  # 33 MB
            gateway.write(STATE[1:], np.zeros(18))
            gateway.write("endoscope/left/image_raw", image)
            gateway.write(STATUS[1:], StringMessage(data=str(word)))
            heard = program.heard(row(gateway, STATUS), 60.0).data
            assert heard == str(word), "publishing waits for the stalled console"
        for _ in range(40):
            assert program.heard(row(gateway, STATE), 60.0)
