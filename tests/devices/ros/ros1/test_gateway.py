"""The gateway to ROS 1, with a real master, as real programs on rospy see it."""

import shutil
import signal
import subprocess
import time
import xmlrpc.client
from contextlib import contextmanager

import numpy as np
import pytest

from devices.ros.ros1.gateway import Ros1Gateway
from devices.ros.ros1.types import checksum, service_checksum
from schemas.codec import message_type
from schemas.crtk import OperatingState
from schemas.ros import StringMessage
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, exercise
from tests.devices.ros.helpers import joint_fields, received, wanted
from tests.devices.ros.rospy_peer import Program, TablePeer, master, needs_rospy
from tests.hub.authorities import free_port
from tests.waiting import LIMIT_S, until, within

pytestmark = [pytest.mark.ros, needs_rospy]

ARM = {"arms": {"PSM1": {}}, "cameras": []}
STATE, COMMAND, EVENT, STATE_COMMAND = (
    "/PSM1/measured_js",
    "/PSM1/servo_jp",
    "/PSM1/operating_state",
    "/PSM1/state_command",
)
RELAY = shutil.which("relay", path="/usr/lib/topic_tools:/opt/ros/noetic/lib/topic_tools")
JOINTS, STATE_TYPE, WORD, ORDER = (
    "sensor_msgs/msg/JointState",
    "crtk_msgs/msg/OperatingState",
    "std_msgs/msg/String",
    "crtk_msgs/msg/StringStamped",
)


@contextmanager
def showing(ros, directory, name="ros", **params):
    with Ros1Gateway(name, Ros1Gateway.params_model.model_validate({"master": ros.uri, **params})) as gateway:
        gateway.open(directory)
        yield gateway


@pytest.fixture(scope="module")
def ros(tmp_path_factory):
    with master(tmp_path_factory.mktemp("ros")) as it:
        yield it


@pytest.fixture
def psm(ros, tmp_path):
    with showing(ros, tmp_path, **ARM) as gateway:
        yield gateway


@pytest.fixture
def console(ros):
    with Program(ros) as program:
        yield program


def joints(values=(0.1,) * 6, stamp_ns=None):
    return joint_fields(values, stamp_ns)


def order(word, stamp_ns=0):
    sec, nanosec = divmod(stamp_ns, 10**9)
    return {"header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": ""}, "string": word}


def came_in(gateway, topic, seconds=LIMIT_S):
    return within(lambda: received(gateway, topic), seconds)


def complaint(gateway):
    """Return why the last message that was refused was so."""

    def reasons():
        return [count.reason for count in gateway._counters._counts.values() if count.refused]

    return until(reasons)[0]


def clients(gateway):
    return [client.name for client in gateway._transport.clients()]


def test_every_row_of_the_table(ros, tmp_path):
    with showing(ros, tmp_path, **WHOLE) as gateway:
        with Program(ros) as console:
            types = sorted({row.type for row in gateway.rows})
            assert console.checksums(types) == [
                (service_checksum if "/srv/" in type_ else checksum)(type_) for type_ in types
            ]
            table = TablePeer(console)
            table.join(gateway.rows)
            exercise(gateway, table)
            assert clients(gateway) == ["/console"]
        with Program(ros, "late") as late:
            check_late_joiner(gateway, TablePeer(late))


def test_the_tools_of_ros_show_it(ros, psm):
    psm.write("PSM1/status", StringMessage(data="a word"))
    listed = subprocess.run(
        ["rostopic", "list"], env=ros.environment, capture_output=True, text=True, timeout=120, check=True
    ).stdout.split()
    assert {row.topic for row in psm.rows if row.way != "serve"} <= set(listed)
    echoed = subprocess.run(
        ["rostopic", "echo", "-n", "1", "/PSM1/status"],
        env=ros.environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    ).stdout
    assert 'data: "a word"' in echoed
    node = "xmlrpc.client.ServerProxy(rosgraph.Master('/t').lookupNode('/trocar_ros'))"
    ask = (
        f"import rosgraph, xmlrpc.client; node = {node}; print(node.getPid('/t')[0],"
        " node.getBusInfo('/t')[0])"
    )
    assert subprocess.run(
        [ros.python, "-c", ask], env=ros.environment, capture_output=True, text=True, timeout=120, check=True
    ).stdout.split() == ["1", "1"]


def test_every_row_of_the_authors_topics(ros, tmp_path):
    arms = {name: WHOLE["arms"][name] for name in ("PSM1", "PSM2", "ECM")}
    with showing(ros, tmp_path, profile="vrep", arms=arms) as gateway, Program(ros) as console:
        table = TablePeer(console)
        table.join(gateway.rows)
        exercise(gateway, table)


@contextmanager
def relay(ros, heard, told):
    """A program on roscpp that says on one topic what it hears on another."""
    with subprocess.Popen(
        [RELAY, heard, told, f"__name:=relay{told.replace('/', '_')}"],
        env=ros.environment,
        stdout=subprocess.DEVNULL,
    ) as process:
        try:
            yield
        finally:
            process.kill()


@pytest.mark.skipif(RELAY is None, reason="needs programs in C++: apt install topic-tools")
def test_programs_in_cpp_hear_and_command(ros, psm, console):
    console.listen("/copied", JOINTS)
    console.advertise("/orders", JOINTS)
    with relay(ros, STATE, "/copied"), relay(ros, "/orders", COMMAND):
        assert until(lambda: psm.write(STATE[1:], np.zeros(18)) or console.heard("/copied", 0.02))
        assert console.wait_for_peers("/orders")
        assert until(lambda: console.send("/orders", joints()) or came_in(psm, COMMAND, 0.1))
        assert clients(psm) == ["/relay_copied", f"/relay{COMMAND.replace('/', '_')}"]
    assert until(lambda: not clients(psm))


def test_a_state_is_wanted_while_a_program_subscribes(ros, psm):
    topic = "/PSM1/setpoint_js"
    assert not wanted(psm, topic)
    psm.read(0)
    with Program(ros) as program:
        program.listen(topic, JOINTS)
        assert psm.wait(60.0)
        assert until(lambda: wanted(psm, topic))
        assert until(lambda: psm.write(topic[1:], np.zeros(18)) or program.heard(topic, 0.02))
        assert not wanted(psm, "/PSM1/measured_cv")
    assert until(lambda: not wanted(psm, topic))


def test_all_states_are_used_as_soon_as_a_program_connects_to_one(ros, psm):
    states = {row.port.name for row in psm.rows if row.port is not None and row.periodic}
    for name in states:
        psm.write(name, psm._states[name]._codec.neutral)
    psm.read(0)
    assert "PSM1/setpoint_cp" in psm.unused()
    with Program(ros) as program:
        program.listen("/PSM1/setpoint_js", JOINTS)
        assert until(lambda: psm.read(0) is not None and not psm.unused())


def test_headers_are_numbered_as_publishers_of_ros_1_do_it(psm, console):
    console.listen(STATE, JOINTS)
    assert until(lambda: clients(psm))
    numbers = []
    while len(numbers) < 4:
        psm.write(STATE[1:], np.zeros(18))
        numbers += console.sequence(STATE)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_a_console_that_comes_back_is_there_again(psm, ros):
    for ending in (signal.SIGTERM, signal.SIGKILL, signal.SIGKILL):
        with Program(ros) as console:
            console.join([(STATE, JOINTS, "publish"), (COMMAND, JOINTS, "subscribe")])
            psm.write(STATE[1:], np.zeros(18))
            assert console.heard(STATE, 60.0)
            console.send(COMMAND, joints())
            assert came_in(psm, COMMAND)
            assert clients(psm) == ["/console"]
            console.process.send_signal(ending)
            assert until(lambda: not clients(psm))


def test_the_gateway_is_closed_and_opened_again(ros, psm, tmp_path, console):
    console.listen(EVENT, STATE_TYPE)
    console.advertise(COMMAND, JOINTS)
    for state in ("DISABLED", "ENABLED"):
        psm.write(EVENT[1:], OperatingState(state=state))
        assert console.heard(EVENT, 60.0)["state"] == state
        assert console.wait_for_peers(COMMAND)
        psm.open(tmp_path)


def test_a_second_console_does_not_command_the_same_arm(psm, ros, console):
    with Program(ros, "second") as second:
        for each in (console, second):
            each.advertise(COMMAND, JOINTS)
            assert each.wait_for_peers(COMMAND)
        second.listen("/PSM1/warning", WORD)
        console.send(COMMAND, joints())
        assert came_in(psm, COMMAND)
        second.send(COMMAND, joints())
        assert "/second may not move the arm" in second.heard("/PSM1/warning", 60.0)["data"]
        assert not came_in(psm, COMMAND, 0.1)


@pytest.mark.parametrize(
    "payload",
    [b"", b"\x00\x01\x00\x00", b"\xff" * 60, bytes(range(256)) * 16],
    ids=["empty", "header", "lengths", "noise"],
)
def test_bytes_that_are_no_message_move_nothing(psm, console, payload):
    console.advertise(COMMAND, JOINTS)
    console.listen("/PSM1/error", WORD)
    assert console.wait_for_peers(COMMAND)
    console.raw(COMMAND, list(payload))
    assert "no such message" in console.heard("/PSM1/error", 60.0)["data"]
    assert not came_in(psm, COMMAND, 0.0)
    console.send(COMMAND, joints())
    assert came_in(psm, COMMAND), "the connection lives on"


def test_another_version_of_a_type_is_refused_with_the_reason(psm, console, caplog):
    console.advertise(COMMAND, WORD)
    console.listen(STATE, WORD)
    assert until(lambda: f"{COMMAND}: " in caplog.text or f"{COMMAND} has MD5" in caplog.text)
    assert until(lambda: f"{STATE} is {JOINTS.replace('/msg', '')} with MD5" in caplog.text)
    assert clients(psm) == []


def test_a_request_that_is_none_gets_an_error(psm, console):
    topic = "/PSM1/local/forward_kinematics"
    console.join([(topic, "crtk_msgs/srv/QueryForwardKinematics", "serve")])
    assert "no such message" in console.refused_call(topic, [1, 2, 3])
    request = message_type("crtk_msgs/srv/QueryForwardKinematics_Request")(jp=np.zeros(6))
    assert console.call(topic, request.model_dump(mode="json"))["result"]


def test_a_latched_command_from_before_is_refused_when_the_gateway_opens(psm, console, tmp_path):
    console.advertise(STATE_COMMAND, ORDER, True)
    console.advertise(COMMAND, JOINTS, True)
    console.send(STATE_COMMAND, order("home"))  # clients of ROS 1 do not stamp it
    assert console.wait_for_peers(STATE_COMMAND)
    assert came_in(psm, STATE_COMMAND), "of a console that comes later it is meant now"
    console.send(COMMAND, joints(stamp_ns=0))
    psm.open(tmp_path)
    assert "published by /console before it was connected" in complaint(psm)
    assert until(lambda: sum(count.refused for count in psm._counters._counts.values()) == 2)
    assert {sample.port for sample in psm.read(0)} == {"gateway", "place"}
    time.sleep(0.2)
    console.send(STATE_COMMAND, order("enable"))
    assert came_in(psm, STATE_COMMAND)


def test_what_a_real_arm_has_kept_is_its_state(ros, tmp_path, console):
    console.advertise("/MTML/operating_state", STATE_TYPE, True)
    console.send(
        "/MTML/operating_state", {**order(""), "state": "ENABLED", "is_homed": True, "is_busy": False}
    )
    with showing(ros, tmp_path, **ARM, listen=["MTML"]) as gateway:
        assert came_in(gateway, "/MTML/operating_state")


def test_a_flood_costs_no_other_console_its_states(psm, ros, console):
    with Program(ros, "flood") as flood:
        flood.advertise(COMMAND, JOINTS)
        console.listen(STATE, JOINTS)
        assert flood.wait_for_peers(COMMAND)
        assert until(lambda: len(clients(psm)) == 2)
        flood.send(COMMAND, joints(), 5000)
        states = []
        for _ in range(40):
            psm.write(STATE[1:], np.zeros(18))
            states.append(console.heard(STATE, 60.0))
        assert all(states)


def test_a_console_that_stops_reading_holds_up_nobody(ros, tmp_path, console):
    picture = {
        "height": 288,
        "width": 320,
        "encoding": "rgb8",
        "step": 960,
        "data": np.zeros(276480, np.uint8),
    }
    image = message_type("sensor_msgs/msg/Image").model_validate(picture)
    topic = "/endoscope/left/image_raw"
    with showing(ros, tmp_path, arms={"PSM1": {}}) as psm, Program(ros, "stalled") as stalled:
        for each in (console, stalled):
            each.join(
                [
                    (STATE, JOINTS, "publish"),
                    ("/PSM1/status", WORD, "publish"),
                    (topic, image.ros_type, "publish"),
                ]
            )
        stalled.process.send_signal(signal.SIGSTOP)
        for word in range(120):  # 33 MB, more than the buffers on the way to the stalled one hold
            psm.write(STATE[1:], np.zeros(18))
            psm.write(topic[1:], image)
            psm.write("PSM1/status", StringMessage(data=str(word)))
            assert console.heard("/PSM1/status", 60.0) == {"data": str(word)}, "it waits for the stalled one"
        numbers = console.sequence(STATE)
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), (
            "another console's stop costs this one states"
        )
        psm.write(EVENT[1:], OperatingState(state="ENABLED"))
        stalled.process.send_signal(signal.SIGCONT)
        assert [stalled.heard("/PSM1/status", 60.0)["data"] for _ in range(120)] == [
            str(word) for word in range(120)
        ], "events are kept for who stops"


def test_two_gateways_of_one_name(ros, psm, tmp_path, console, caplog):
    console.listen(EVENT, STATE_TYPE)
    with showing(ros, tmp_path, **ARM, namespace="other"):
        assert until(lambda: "has the name '/trocar_ros'" in caplog.text)
    psm.write(EVENT[1:], OperatingState(state="ENABLED"))
    assert console.heard(EVENT, 60.0)["state"] == "ENABLED"
    with showing(ros, tmp_path, "second", **ARM, namespace="other") as other:
        console.advertise(f"/other{COMMAND}", JOINTS)
        assert console.wait_for_peers(f"/other{COMMAND}")
        console.send(f"/other{COMMAND}", joints())
        assert came_in(other, COMMAND)


def test_the_place_of_one_that_was_killed_is_taken(ros, tmp_path, console, caplog):
    with xmlrpc.client.ServerProxy(ros.uri) as known:
        assert (
            known.registerPublisher(
                "/trocar_ros", STATE, JOINTS.replace("/msg", ""), f"http://127.0.0.1:{free_port()}/"
            )[0]
            == 1
        )
        console.listen(STATE, JOINTS)
        with showing(ros, tmp_path, **ARM) as psm:
            assert until(lambda: clients(psm) == ["/console"])
            psm.write(STATE[1:], np.zeros(18))
            assert console.heard(STATE, 60.0)
        assert "another program" not in caplog.text
        assert known.lookupNode("/test", "/trocar_ros")[0] != 1, "at its end it is not known any more"


def test_a_console_that_cannot_be_reached_is_told_of_once(ros, psm, console, caplog):
    with xmlrpc.client.ServerProxy(ros.uri) as known:
        for topic in (COMMAND, STATE_COMMAND):
            known.registerPublisher("/unknown", topic, "*", "http://nowhere.invalid:1/")
        assert until(lambda: "Its ROS_IP or ROS_HOSTNAME must be an address" in caplog.text)
        console.advertise(COMMAND, JOINTS)
        assert console.wait_for_peers(COMMAND)
        for topic in (COMMAND, STATE_COMMAND):
            known.unregisterPublisher("/unknown", topic, "http://nowhere.invalid:1/")
        assert until(lambda: not any("nowhere" in uri for uri in psm._transport._subscriptions._links))
    assert caplog.text.count("cannot be reached") == 1


def test_a_master_that_comes_later_and_one_that_starts_again(tmp_path, caplog):
    with master(tmp_path) as ros:
        ros.stop()
        with showing(ros, tmp_path, **ARM) as psm:
            assert until(lambda: "waiting for the master" in caplog.text)
            ros.start()
            with Program(ros, "first") as first:
                first.join([(STATE, JOINTS, "publish"), (COMMAND, JOINTS, "subscribe")])
                ros.stop()
                ros.start()
                with Program(ros, "second") as second:
                    second.join([(STATE, JOINTS, "publish"), (COMMAND, JOINTS, "subscribe")])
                    for each in (first, second):
                        assert until(
                            lambda each=each: psm.write(STATE[1:], np.zeros(18)) or each.heard(STATE, 0.1)
                        ), "whoever was connected stays so"
                first.send(COMMAND, joints())
                assert came_in(psm, COMMAND)
            ros.stop()
            assert caplog.text.count("waiting for the master") <= 4
