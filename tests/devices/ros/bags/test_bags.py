"""Bags both ways: a session that a program has driven becomes a bag with ROS names, and the bag drives a new
session, to the same bits.
"""

import json
import subprocess
import sys
import threading
import time
from base64 import b64encode
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from typer.testing import CliRunner

from devices.ros.bags import export as bag_export
from devices.ros.bags.export import export
from devices.ros.command_line import app
from devices.ros.zenoh.gateway import ZenohGateway
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.codec import message_type, validate_message
from schemas.errors import MessageError, RecordingError
from schemas.vectors import VectorCodec
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rospy_peer import environment, needs_rospy, rospy_python
from tests.devices.ros.zenoh.test_gateway import JOINTS, STATE_TYPE, joints
from tests.devices.ros.zenoh.zenoh_peer import TYPES, Peer, built
from tests.waiting import until

pytestmark = pytest.mark.xdist_group("bags")  # its fixtures are expensive: made once, in one process

__all__ = ["rclpy_python"]

pytest.importorskip("mujoco")
pytest.importorskip("ruckig")

SCENARIO = """
name: bags
step: 2 ms
duration: {duration}
pace: {pace}
participants:
  motion:
    kind: motion
    mounting: cart
    publish_period: 10 ms
    power_time: 20 ms
    arms: &psm {{PSM1: {{instrument: "400006", start: [0, 0, 120 mm, 0, 0, 0]}}}}
  robot: {{kind: mujoco, mounting: cart, publish_period: 10 ms, looks: false, arms: *psm}}
  ros: {device}
order: [motion, robot]
connections:
  - ros.* -> motion.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
"""
MEASURED = "/engine/motion/out/PSM1/measured_js"
GOALS = [0.02, -0.01, 0.125, 0.05, 0.0, 0.1]


def recorded(directory, device, connections="", *, pace="fast", duration="20 s", drive=None):
    """Run the scenario with `device` as `ros`, and return its recording; `drive` gets the endpoint of
    programs, in a thread.
    """
    directory.mkdir()
    file = directory / "bags.yaml"
    file.write_text(SCENARIO.format(device=device, pace=pace, duration=duration) + connections)
    session = launch(load(str(file)), endpoint="tcp/127.0.0.1:0", record=directory / "recording")
    failures = []

    def driving():
        try:
            drive(session.programs_endpoint)
        except Exception as error:  # noqa: BLE001  # it is raised in the main thread
            failures.append(error)
        session.state.shutdown()

    thread = threading.Thread(target=driving)
    if drive is not None:
        thread.start()
    session.run()
    if drive is not None:
        thread.join()
    assert not failures, failures
    return Recording(directory / "recording")


def operate(endpoint):
    """Home the arm, move it, lead it, close the jaw; and send what must be refused."""
    heard = []
    sec, nanosec = divmod(time.time_ns(), 10**9)
    # a console machine whose clock is fast
    home = {"header": {"stamp": {"sec": sec + 60, "nanosec": nanosec}, "frame_id": ""}, "string": "home"}
    assert until(lambda: reachable(endpoint)), "no hub"
    with Peer(endpoint) as program:
        program.listen(
            "/PSM1/operating_state",
            STATE_TYPE,
            lambda message, _: heard.append((message.state, message.is_homed, message.is_busy)),
            latched=True,
        )
        command = program.publisher("/PSM1/state_command", "crtk_msgs/msg/StringStamped")
        move, servo, jaw = (
            program.publisher(f"/PSM1/{name}", JOINTS) for name in ("move_jp", "servo_jp", "jaw/servo_jp")
        )
        assert until(lambda: heard), "no state came"
        command(built(TYPES, "crtk_msgs/msg/StringStamped", home))
        assert until(lambda: ("ENABLED", True, False) in heard), heard
        heard.clear()
        move(joints(GOALS))
        assert until(lambda: any(busy for _, _, busy in heard))
        jaw(joints([0.3]))
        servo(joints([0.0] * 5))  # one joint is missing
        assert until(lambda: heard[-1] == ("ENABLED", True, False)), heard
        for k in range(20):
            servo(joints([GOALS[0] + 0.001 * k, *GOALS[1:]]))
            time.sleep(0.005)
        # what enters at the very last communication point is of no effect, and no other session has that
        # point
        time.sleep(0.1)


def reachable(endpoint):
    try:
        Peer(endpoint, "probe").close()
    except Exception:  # noqa: BLE001  # whatever Zenoh says while nobody listens
        return False
    return True


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """The recording of a session that a program has driven through a gateway."""
    gateway = "{kind: ros2-zenoh, mounting: cart, arms: *psm, cameras: []}"
    return recorded(
        tmp_path_factory.mktemp("bags") / "driven",
        gateway,
        "  - motion.* -> ros.*\n",
        pace="realtime",
        drive=operate,
    )


@pytest.fixture(scope="module")
def bag(driven):
    export(driven, driven.directory() / "bag")
    return driven.directory() / "bag"


def values(recording, topic):
    return [(message.time_ns, message.payload) for message in recording.messages(topic)]


def messages(bag, *topics):
    """Return (topic, time in s since the bag's start, message) of `topics`."""
    with AnyReader([bag]) as reader:
        wanted = [connection for connection in reader.connections if connection.topic in topics]
        read = reader.messages(wanted) if wanted else ()
        return [
            (c.topic, (time_ns - reader.start_time) * 1e-9, reader.deserialize(payload, c.msgtype))
            for c, time_ns, payload in read
        ]


@pytest.mark.long
def test_a_bag_of_a_session_drives_another_one_to_the_same_bits(driven, bag):
    """Of what the program sent on its own time all comes at the same communication points again."""
    then = values(driven, MEASURED)
    replayed = recorded(
        driven.directory() / "replayed",
        f"{{kind: ros-bag, bag: {bag}, arms: *psm}}",
        duration=f"{then[-1][0]} ns",
    )
    assert values(replayed, MEASURED) == then
    sent, again = (
        [time_ns for time_ns, _ in values(recording, "/device/ros/out/PSM1/servo_jp")]
        for recording in (driven, replayed)
    )
    assert len(sent) == 20
    assert again == sent
    assert verify(replayed).same


@pytest.mark.long
def test_it_has_the_names_the_pace_and_the_quality_that_programs_expect(driven, bag):
    with AnyReader([bag]) as reader:
        quality = {
            connection.topic: connection.ext.offered_qos_profiles[0] for connection in reader.connections
        }
        assert 0 <= reader.start_time - driven.started_ns() < 10**9
    assert {topic for topic, told in quality.items() if told.durability == QosDurability.TRANSIENT_LOCAL} == {
        *(
            f"/PSM1/{name}"
            for name in ("operating_state", "desired_state", "tool_type", "status", "goal_reached")
        ),
        "/SUJ/PSM1/operating_state",
    }
    assert {told.reliability for told in quality.values()} == {QosReliability.RELIABLE}
    assert {
        "/tf",
        "/joint_states",
        "/PSM1/measured_cp",
        "/PSM1/state_command",
        "/PSM1/jaw/servo_jp",
    } <= quality.keys()
    told = messages(bag, "/PSM1/measured_js")
    np.testing.assert_allclose(np.diff([t for _, t, _ in told]), 0.01, atol=1e-6)
    assert told[-1][2].position[0] > GOALS[0]
    states = messages(bag, "/PSM1/operating_state")
    stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, _, message in states]
    assert stamps == sorted(set(stamps))
    assert [(m.state, m.is_homed, m.is_busy) for _, _, m in states][-1] == ("ENABLED", True, False)
    tf, *_ = messages(bag, "/tf")
    assert {(edge.header.frame_id, edge.child_frame_id) for edge in tf[2].transforms} == {
        ("Cart", "PSM1_base"),
        ("PSM1_base", "PSM1"),
    }


def test_states_are_what_the_gateway_would_have_written(driven, bag):
    """The gateway's own port writes the same bytes of the same values, but for the stamp."""
    gateway = ZenohGateway(
        "ros",
        ZenohGateway.params_model.model_validate(
            {"mounting": "cart", "arms": {"PSM1": {"instrument": "400006"}}, "cameras": []}
        ),
    )
    ports = {row.topic: row.port for row in gateway.rows if row.periodic and row.port is not None}
    for topic in (
        "/PSM1/measured_js",
        "/PSM1/local/measured_cp",
        "/PSM1/spatial/jacobian",
        "/PSM1/body/measured_cf",
    ):
        port, (_, _, last) = ports[topic], messages(bag, topic)[-1]
        recorded = driven[f"motion.{topic.removeprefix('/')}"].values
        header = getattr(last, "header", None)
        assert header is None or header.frame_id == port.frame
        assert (
            VectorCodec(port).from_message(validate_message(message_type(port.type), last)).tolist()
            == recorded[-1].tolist()
        )


def test_the_command_writes_it(driven, tmp_path):
    out = json.loads(
        CliRunner()
        .invoke(app, ["bag", str(driven.directory() / "recording"), "-o", str(tmp_path / "bag"), "--json"])
        .stdout
    )
    assert (out["gateway"], out["bag"]) == ("ros", str(tmp_path / "bag"))
    with AnyReader([tmp_path / "bag"]) as reader:
        assert (reader.message_count, len(reader.connections)) == (out["messages"], out["topics"])


READER = """
import json, sys
from base64 import b64decode
from importlib import import_module
from rclpy.serialization import deserialize_message

for line in sys.stdin:
    name, payload = json.loads(line)
    package, kind, type_ = name.split("/")
    message = deserialize_message(b64decode(payload), getattr(import_module(f"{package}.{kind}"), type_))
    state = message.state if type_ == "OperatingState" else None
    print(json.dumps(list(message.position) if type_ == "JointState" else state))
"""


def test_ros_reads_it(bag, rclpy_python):
    """Every message, by the type support that `ros2 bag play` and its listeners have."""
    with AnyReader([bag]) as reader:
        told = [
            (c.msgtype, payload, reader.deserialize(payload, c.msgtype))
            for c, _, payload in reader.messages()
        ]
    lines = "".join(json.dumps((type_, b64encode(payload).decode())) + "\n" for type_, payload, _ in told)
    read = subprocess.run(
        [rclpy_python, "-c", READER], input=lines, capture_output=True, text=True, timeout=60, check=False
    )
    assert read.returncode == 0, read.stderr
    said = [
        m.position.tolist() if type_ == JOINTS else m.state if type_ == STATE_TYPE else None
        for type_, _, m in told
    ]
    assert [json.loads(line) for line in read.stdout.splitlines()] == said


ROSBAG = """
import json, sys
import rosbag

with rosbag.Bag(sys.argv[1]) as bag:
    latched = [c.topic for c in bag._get_connections() if c.header.get("latching") == b"1"]
    states = [list(m.position) for _, m, _ in bag.read_messages("/PSM1/measured_js")]
    print(json.dumps([sorted(latched), states]))
"""


@pytest.mark.ros
@needs_rospy
def test_ros_1_reads_it_once_it_is_converted(bag, tmp_path):
    converter = Path(sys.executable).with_name("rosbags-convert")
    subprocess.run([converter, "--src", bag, "--dst", tmp_path / "one.bag"], check=True)
    python, path = rospy_python()
    read = subprocess.run(
        [python, "-c", ROSBAG, tmp_path / "one.bag"],
        env=environment(path),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if "No module named 'rosbag'" in read.stderr:
        pytest.skip("needs rosbag: apt install python3-rosbag")
    assert read.returncode == 0, read.stderr
    latched, positions = json.loads(read.stdout)
    assert "/PSM1/operating_state" in latched
    assert "/PSM1/measured_js" not in latched
    assert positions == [message.position.tolist() for _, _, message in messages(bag, "/PSM1/measured_js")]


def test_what_cannot_be_written_is_said(driven, bag, tmp_path):
    with pytest.raises(RecordingError, match="exists already"):
        export(driven, bag)
    with pytest.raises(RecordingError, match=r"no gateway 'rso'\. Did you mean 'ros'\?"):
        export(driven, tmp_path / "bag", "rso")
    robot = tmp_path / "robot.yaml"
    robot.write_text(
        "name: robot\nstep: 5 ms\nduration: 10 ms\nparticipants:\n"
        "  robot: {kind: mujoco, arms: {PSM1: {instrument: '400006'}}}\n"
    )
    launch(load(str(robot)), record=tmp_path / "bare").run()
    with pytest.raises(RecordingError, match="neither a gateway to ROS nor a participant of kind `motion`"):
        export(Recording(tmp_path / "bare"), tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_a_session_without_a_gateway_has_the_topics_of_its_motion_controller(bag, tmp_path):
    device = f"{{kind: ros-bag, bag: {bag}, arms: *psm}}"
    replayed = recorded(tmp_path / "replayed", device, duration="100 ms")
    export(replayed, tmp_path / "bag")
    measured = [
        message.position.tolist() for _, _, message in messages(tmp_path / "bag", "/PSM1/measured_js")
    ]
    assert measured == replayed["motion.PSM1/measured_js"]["position"].tolist()


def test_a_bag_that_cannot_be_finished_is_not_left_behind(driven, tmp_path, monkeypatch):
    def none_of_that_type(model, payload):
        raise MessageError(f"{model.ros_type}: {len(payload)} bytes are no such message")

    monkeypatch.setattr(bag_export, "decode", none_of_that_type)
    with pytest.raises(
        RecordingError,
        match=(
            r"topic '/engine/motion/out/PSM1/operating_state' at 2000000 ns: crtk_msgs/msg/OperatingState:"
            r" \d+ bytes"
        ),
    ):
        export(driven, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot write the bag"):
        export(driven, tmp_path / "file" / "bag")
