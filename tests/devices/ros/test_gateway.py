from __future__ import annotations

from collections.abc import Generator
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep, time_ns
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.ros.params import GatewayParams
from devices.ros.topics import arbitration
from hub.testing import check_device
from schemas.codec import encode
from schemas.crtk import ForwardKinematicsRequest, OperatingState, StringStamped
from schemas.errors import DeviceError, MessageError
from schemas.files import Files
from schemas.message import Message
from schemas.ros import (
    BoolMessage,
    CameraInfo,
    DiagnosticArray,
    EmptyMessage,
    Float64MultiArray,
    Header,
    Image,
    JointState,
    Point,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    StringMessage,
    TFMessage,
    Time,
    WrenchStamped,
)
from schemas.trocar_msgs import GatewayStatus
from schemas.visualization import Marker, MarkerArray
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, exercise, sample
from tests.devices.ros.memory import MemoryGateway, MemoryPeer

SMALL: dict[str, Any] = {
    "arms": {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006"}, "ECM": {}},
    "listen": ["MTML"],
}


def make(params: dict[str, Any] = SMALL) -> MemoryGateway:
    return MemoryGateway("ros", GatewayParams.model_validate(params, context=Files(Path()).context))


@pytest.fixture
def gateway(tmp_path: Path) -> Generator[MemoryGateway]:
    with make() as gateway:
        gateway.open(tmp_path)
        yield gateway


def commands(gateway: MemoryGateway) -> list[tuple[str, Message]]:
    return [
        (sample.port, sample.message) for sample in gateway.read(0) if sample.port not in ("gateway", "place")
    ]


def words(gateway: MemoryGateway, topic: str) -> list[str]:
    return [message.data for message in gateway.transport.heard(topic) if isinstance(message, StringMessage)]


def joints(*positions: float) -> JointState:
    return JointState(position=np.array(positions))


def test_every_row_of_the_table(tmp_path: Path) -> None:
    with make(WHOLE) as gateway:
        gateway.open(tmp_path)
        peer = MemoryPeer(gateway.transport)
        peer.join(gateway.rows)
        exercise(gateway, peer)
        check_late_joiner(gateway, MemoryPeer(gateway.transport))


def test_it_keeps_the_contract_of_a_device() -> None:
    check_device(make)


def test_a_second_time_it_begins_anew(tmp_path: Path) -> None:
    with make() as gateway:
        gateway.open(tmp_path)
        first = gateway.transport
        gateway.write("PSM1/status", StringMessage(data="one"))
        gateway.close()
        assert first.closed == 1
        gateway.open(tmp_path)
        assert gateway.transport.heard("/PSM1/status") == []


def test_latched_events_from_before_it_was_open_are_published(tmp_path: Path) -> None:
    with make() as gateway:
        gateway.write("PSM1/operating_state", OperatingState(state="DISABLED"))
        gateway.write("PSM1/operating_state", OperatingState(state="ENABLED"))
        gateway.write("endoscope/left/image_raw", Image())
        gateway.open(tmp_path)
        (told,) = gateway.transport.heard("/PSM1/operating_state")
        assert isinstance(told, OperatingState)
        assert told.state == "ENABLED"
        assert gateway.transport.heard("/endoscope/left/image_raw") == []


def test_an_unknown_port_is_reported_with_a_near_miss(gateway: MemoryGateway) -> None:
    with pytest.raises(MessageError, match="Did you mean 'PSM1/measured_js'"):
        gateway.write("PSM1/measured_jx", np.zeros(18))


def test_states_are_published_at_its_own_rate_whatever_the_simulation_does(tmp_path: Path) -> None:
    with make(SMALL | {"publish_period": "4 ms"}) as gateway:
        gateway.open(tmp_path)
        gateway.write("PSM1/measured_js", np.arange(18.0))
        sleep(0.2)
        told = gateway.transport.heard("/PSM1/measured_js")
    stamps = [message.header.stamp.ns for message in told if isinstance(message, JointState)]
    assert len(stamps) >= 10
    assert all(one < other for one, other in pairwise(stamps))
    assert np.median(np.diff(stamps)) == pytest.approx(4e6, rel=0.5)
    assert gateway.transport.published["/ECM/measured_js"] == []  # it has no value


def test_a_state_is_used_while_a_program_subscribes_and_counted_as_before(gateway: MemoryGateway) -> None:
    topic, port = "/PSM1/setpoint_js", "PSM1/setpoint_js"
    heard, times_ns = gateway.transport.published[topic], iter(range(0, 10**12, 10**9))

    def count() -> int:
        samples = gateway.read(next(times_ns))
        (status,) = [s.message for s in samples if isinstance(s.message, GatewayStatus)]
        return next((one.messages for one in status.topics if one.topic == topic), 0)

    gateway.transport.let_go(topic)
    assert count() == 0
    assert port not in gateway.unused()  # its first value tells that it is there
    gateway.write(port, np.arange(18.0))
    assert count() >= 0
    assert set(gateway.unused()) == {port}
    assert gateway.unused() is gateway.unused()
    before = count()
    gateway.write("PSM1/measured_js", np.arange(18.0))  # the simulation runs
    sleep(0.1)
    assert count() > before
    assert heard == []
    gateway.transport.let_go()
    assert gateway.wait(60.0)
    gateway.read(0)
    assert set(gateway.unused()) == set()
    sleep(0.05)
    assert heard == []  # the value from before is old
    gateway.write(port, np.ones(18))
    sleep(0.1)
    first = gateway.transport.heard(topic)[0]
    assert isinstance(first, JointState)
    np.testing.assert_array_equal(first.position, np.ones(6))


def test_all_states_are_used_for_a_while_when_a_program_joins(gateway: MemoryGateway) -> None:
    """It asks once, perhaps as soon as it has subscribed."""
    gateway.transport.let_go(*(row.topic for row in gateway.rows))
    for name in {row.port.name for row in gateway.rows if row.port is not None and row.periodic}:
        gateway.write(name, gateway._states[name]._codec.neutral)
    gateway.read(0)
    assert "PSM1/setpoint_cp" in gateway.unused()
    gateway.transport.joined_s = monotonic()
    gateway.transport.changed()
    gateway.read(0)
    assert set(gateway.unused()) == set()
    gateway.transport.joined_s -= 60.0
    gateway.read(10**12)  # once a second
    assert "PSM1/setpoint_cp" in gateway.unused()


def test_what_the_gateway_reads_itself_is_always_used(gateway: MemoryGateway) -> None:
    gateway.transport.let_go(*(row.topic for row in gateway.rows))
    states = {row.port.name for row in gateway.rows if row.port is not None and row.periodic}
    for name in states:
        gateway.write(name, gateway._states[name]._codec.neutral)
    gateway.read(10**18)
    assert {"PSM1/measured_js", "PSM1/jaw/measured_js", "ECM/local/measured_cp", "SUJ/PSM1/measured_cp"} <= (
        states - set(gateway.unused())
    )
    assert {"PSM1/measured_cp", "PSM1/body/jacobian", "ECM/setpoint_js"} <= set(gateway.unused())
    gateway.transport.let_go("/PSM1/measured_js")
    sleep(0.1)
    assert gateway.transport.published["/joint_states"]
    assert gateway.transport.published["/tf"]
    assert gateway.transport.published["/PSM1/measured_js"] == []


def test_a_picture_that_nobody_sees_is_counted_and_not_sent(gateway: MemoryGateway) -> None:
    topic = "/endoscope/left/image_raw"
    gateway.transport.let_go(topic)
    gateway.write(topic[1:], Image())
    (status,) = [s.message for s in gateway.read(10**18) if isinstance(s.message, GatewayStatus)]
    assert [one.messages for one in status.topics if one.topic == topic] == [1]
    assert gateway.transport.published[topic] == []


def test_an_old_state_is_not_published_any_more(
    gateway: MemoryGateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("devices.ros.topics.publications._MAX_AGE_NS", 50_000_000)
    gateway.write("PSM1/measured_js", np.arange(18.0))
    sleep(0.2)
    count = len(gateway.transport.published["/PSM1/measured_js"])
    sleep(0.1)
    assert 0 < count == len(gateway.transport.published["/PSM1/measured_js"])


def test_stamps_increase_though_the_clock_is_set_back(
    gateway: MemoryGateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = iter([10**18, 10**18, 5 * 10**17])
    monkeypatch.setattr("devices.ros.topics.stamps.time_ns", lambda: next(times))
    for _ in range(3):
        gateway.write(
            "PSM1/operating_state", OperatingState(header=Header(stamp=Time(sec=3)), state="ENABLED")
        )
    stamps = [
        message.header.stamp.ns - 10**18
        for message in gateway.transport.heard("/PSM1/operating_state")
        if isinstance(message, OperatingState)
    ]
    assert stamps == [0, 1, 2]


def test_frames_from_the_cart_to_tips_and_camera(tmp_path: Path) -> None:
    with make(SMALL | {"mounting": "cart"}) as gateway:
        gateway.open(tmp_path)
        for name in (
            "SUJ/PSM1/local/measured_cp",
            "PSM1/local/measured_cp",
            "SUJ/ECM/local/measured_cp",
            "ECM/local/measured_cp",
        ):
            gateway.write(name, np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]))
        sleep(0.1)
        told = gateway.transport.heard("/tf")[-1]
    assert isinstance(told, TFMessage)
    edges = {(one.header.frame_id, one.child_frame_id) for one in told.transforms}
    assert edges == {
        ("Cart", "PSM1_base"),
        ("PSM1_base", "PSM1"),
        ("Cart", "ECM_base"),
        ("ECM_base", "ECM"),
        ("ECM", "endoscope_left_optical"),
    }
    assert len({child for _, child in edges}) == len(edges)
    assert len({one.header.stamp.ns for one in told.transforms}) == 1
    for one in told.transforms[:4]:
        assert one.transform.model_dump() == {
            "translation": {"x": 1.0, "y": 2.0, "z": 3.0},
            "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        }


def test_joint_states_of_all_arms(gateway: MemoryGateway) -> None:
    gateway.write("PSM1/measured_js", np.arange(18.0))
    gateway.write("PSM1/jaw/measured_js", np.array([0.5, 0.6, 0.7]))
    gateway.write("ECM/measured_js", np.arange(12.0))
    sleep(0.05)
    told = gateway.transport.heard("/joint_states")[-1]
    assert isinstance(told, JointState)
    assert told.name == [
        f"PSM1_{name}" for name in ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw", "jaw")
    ] + [f"ECM_{name}" for name in ("yaw", "pitch", "insertion", "roll")]
    assert told.position.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 0.5, 0.0, 1.0, 2.0, 3.0]
    assert told.velocity.tolist() == [6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 0.6, 4.0, 5.0, 6.0, 7.0]


def test_a_description_is_latched(tmp_path: Path) -> None:
    file = tmp_path / "dvrk.urdf"
    file.write_text(
        '<robot name="dvrk"><mesh filename="assets/tip.obj" /><mesh filename="package://dvrk/tip.obj"'
        " /></robot>"
    )
    with make(SMALL | {"robot_description": str(file)}) as gateway:
        gateway.open(tmp_path)
        (told,) = words(gateway, "/robot_description")
        assert (
            told == f'<robot name="dvrk"><mesh filename="{tmp_path.as_uri()}/assets/tip.obj" /><mesh'
            ' filename="package://dvrk/tip.obj" /></robot>'
        )
        assert gateway.transport.rows["/robot_description"].latched


@pytest.mark.parametrize(
    "content",
    [
        b"solid tip",
        b"\xff\xfe",
        b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]><robot>&b;</robot>',
        b"<!DOCTYPE a [<!ENTITY a 'aaaaaaaaaa'>"
        + b"".join(b"<!ENTITY %c '%b'>" % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9))
        + b"]><robot>&j;</robot>",
    ],
    ids=["another format", "not UTF-8", "a file of this machine", "a billion laughs"],
)
def test_a_description_that_is_none(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "dvrk.urdf"
    file.write_bytes(content)
    with (
        make(SMALL | {"robot_description": str(file)}) as gateway,
        pytest.raises(DeviceError, match="is no URDF"),
    ):
        gateway.open(tmp_path)


def test_a_service_without_a_session_says_so(gateway: MemoryGateway) -> None:
    peer = MemoryPeer(gateway.transport)
    answer = peer.call(
        gateway.transport.rows["/PSM1/forward_kinematics"], ForwardKinematicsRequest(jp=np.zeros(6))
    )
    assert "is the session running" in getattr(answer, "message", "")


BAD: list[tuple[str, Message | bytes, str]] = [
    ("servo_jp", joints(*[0.0] * 5), "5 values in position, expected 6"),
    ("servo_jp", joints(*[0.0] * 1000), "1000 values in position, expected 6"),
    ("servo_jp", JointState(), "no position is stated, expected 6"),
    ("servo_jp", JointState(position=np.zeros(6), velocity=np.zeros(2)), "2 values in velocity"),
    ("servo_jp", JointState(name=["a"], position=np.zeros(6)), "1 values in name"),
    ("servo_jf", joints(*[0.0] * 6), "no effort is stated"),
    ("jaw/move_jp", joints(0.1, 0.2), "2 values in position, expected 1"),
    ("servo_cp", PoseStamped.model_validate({"pose": {"orientation": {"w": 0.0}}}), "norm 0, expected 1"),
    ("move_cp", PoseStamped.model_validate({"pose": {"orientation": {"w": 2.0}}}), "norm 2, expected 1"),
    (
        "servo_jp",
        encode(joints(*[1e300] * 6)).replace(b"\x9c\x75\x00\x88\x3c\xe4\x37\x7e", b"\x00" * 6 + b"\xf8\x7f"),
        "finite",
    ),
    ("servo_jp", b"", "no such message"),
    ("servo_jp", b"\x00\x01\x00\x00\xff", "no such message"),
    ("servo_jp", encode(joints(0.0))[:-3], "no such message"),
]


@pytest.mark.parametrize(("name", "message", "reason"), BAD)
def test_what_is_no_command_is_an_error_on_the_arms_topic(
    gateway: MemoryGateway, name: str, message: Message | bytes, reason: str
) -> None:
    gateway.transport.send(f"/PSM1/{name}", message)
    assert commands(gateway) == []
    (told,) = words(gateway, "/PSM1/error")
    assert told.startswith(f"PSM1: {name} refused: ")
    assert reason in told
    assert words(gateway, "/PSM1/warning") == []


@given(positions=st.lists(st.floats(), max_size=8), velocities=st.lists(st.floats(), max_size=8))
def test_only_six_finite_positions_move_an_arm(positions: list[float], velocities: list[float]) -> None:
    gateway = _opened()
    raw = _cdr(positions, velocities)
    gateway.transport.send("/PSM1/servo_jp", raw)
    good = (
        len(positions) == 6
        and len(velocities) in (0, 6)
        and bool(np.isfinite([*positions, *velocities]).all())
    )
    assert len(commands(gateway)) == good


@given(q=st.tuples(*[st.floats(-2.0, 2.0)] * 4))
def test_only_unit_quaternions_are_orientations(q: tuple[float, ...]) -> None:
    gateway = _opened()
    pose = PoseStamped.model_validate({"pose": {"orientation": dict(zip("xyzw", q, strict=True))}})
    good = abs(float(np.linalg.norm(q)) - 1.0) <= 1e-3
    for topic in ("/PSM1/servo_cp", "/PSM1/move_cp"):
        gateway.transport.send(topic, pose)
    assert len(commands(gateway)) == 2 * good
    assert len(words(gateway, "/PSM1/error")) == 2 * (not good)


@given(payload=st.binary(max_size=200))
def test_no_bytes_bring_it_down(payload: bytes) -> None:
    gateway = _opened()
    for topic in ("/PSM1/servo_jp", "/PSM1/servo_cs", "/PSM1/state_command", "/MTML/measured_js"):
        gateway.transport.send(topic, payload)
        gateway.transport.send(topic, b"\x00\x01\x00\x00" + payload)
    for _, message in commands(gateway):
        encode(message)


_KEPT: list[MemoryGateway] = []


def _opened() -> MemoryGateway:
    """Return an open gateway that no other example has sent anything, without making a new one each time."""
    if not _KEPT:
        _KEPT.append(make())
    gateway = _KEPT[0]
    gateway.open(Path.cwd())
    return gateway


@pytest.fixture(autouse=True, scope="module")
def _closed() -> Generator[None]:
    yield
    for gateway in _KEPT:
        gateway.close()


def _cdr(positions: list[float], velocities: list[float]) -> bytes:
    """Return a JointState with any numbers, which our own models refuse to write."""
    marks = [float(i + 1) * 1.2345e-7 for i in range(len(positions) + len(velocities))]
    raw = encode(
        JointState(position=np.array(marks[: len(positions)]), velocity=np.array(marks[len(positions) :]))
    )
    for mark, number in zip(marks, [*positions, *velocities], strict=True):
        raw = raw.replace(np.float64(mark).tobytes(), np.float64(number).tobytes(), 1)
    return raw


def test_the_console_has_warnings_only(gateway: MemoryGateway) -> None:
    gateway.transport.send("/console/teleop/set_scale", b"nonsense")
    (told,) = words(gateway, "/console/warning")
    assert told.startswith("console: teleop/set_scale refused: std_msgs/msg/Float64")


def test_a_latched_command_from_before_is_refused(gateway: MemoryGateway) -> None:
    old, now = (
        StringStamped(header=Header(stamp=Time.from_ns(stamp)), string="home")
        for stamp in (time_ns() - 10**11, time_ns())
    )
    gateway.transport.send("/PSM1/state_command", old)
    assert commands(gateway) == []
    (told,) = words(gateway, "/PSM1/warning")
    assert "before this gateway was open" in told
    gateway.transport.send("/PSM1/state_command", now)
    gateway.transport.send("/PSM1/state_command", StringStamped(string="enable"))  # from `ros2 topic pub`
    assert commands(gateway) == [
        ("PSM1/state_command", now),
        ("PSM1/state_command", StringStamped(string="enable")),
    ]


def test_a_command_that_a_connection_delivers_again_is_refused(gateway: MemoryGateway) -> None:
    command = StringStamped(header=Header(stamp=Time.from_ns(time_ns())), string="home")
    for _ in range(2):
        gateway.transport.send("/PSM1/state_command", command)
    assert len(commands(gateway)) == 1
    (told,) = words(gateway, "/PSM1/warning")
    assert "accepted before" in told


def test_one_program_at_a_time_commands_an_arm(
    gateway: MemoryGateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0]
    monkeypatch.setattr(arbitration, "monotonic_ns", lambda: now[0])
    gateway.transport.send("/PSM1/servo_jp", joints(*[0.1] * 6), "/one")
    gateway.transport.send("/PSM1/jaw/servo_jp", joints(0.1), "/other")
    gateway.transport.send("/PSM1/move_jp", joints(*[0.2] * 6), "/other")
    gateway.transport.send("/PSM1/hold", EmptyMessage(), "/other")
    gateway.transport.send("/ECM/servo_jp", joints(*[0.1] * 4), "/other")
    assert [port for port, _ in commands(gateway)] == ["PSM1/servo_jp", "PSM1/hold", "ECM/servo_jp"]
    assert all(
        "/other may not move the arm while /one commands it" in told
        for told in words(gateway, "/PSM1/warning")
    )
    now[0] = 1_000_000_001
    gateway.transport.send("/PSM1/move_jp", joints(*[0.2] * 6), "/other")
    assert [port for port, _ in commands(gateway)] == ["PSM1/move_jp"]
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True, is_busy=True))
    now[0] = 9_000_000_000
    gateway.transport.send("/PSM1/servo_jp", joints(*[0.1] * 6), "/one")
    assert commands(gateway) == []  # the move of the other one goes on
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True, is_busy=False))
    gateway.transport.send("/PSM1/servo_jp", joints(*[0.1] * 6), "/one")
    assert [port for port, _ in commands(gateway)] == ["PSM1/servo_jp"]


def test_one_program_at_a_time_commands_a_master(tmp_path: Path) -> None:
    push = WrenchStamped(header=Header(frame_id="MTML_tip"))
    with make({"arms": {"MTML": {}}, "mounting": "cart"}) as gateway:
        gateway.open(tmp_path)
        gateway.transport.send("/MTML/body/servo_cf", push, "/one")
        gateway.transport.send("/MTML/servo_jp", joints(*[0.1] * 7), "/other")
        gateway.transport.send("/MTML/servo_jp", joints(*[0.1] * 6), "/one")
        assert [port for port, _ in commands(gateway)] == ["MTML/body/servo_cf"]
        (told,) = words(gateway, "/MTML/warning")
        assert "/other may not move the arm while /one commands it" in told
        assert "6 values in position, expected 7" in words(gateway, "/MTML/error")[0]


def test_a_flood_is_thinned_out_and_told_once(gateway: MemoryGateway) -> None:
    payload = encode(joints(*[0.1] * 6))
    for _ in range(3000):
        gateway.transport.send("/PSM1/servo_jp", payload)
    assert 150 <= len(commands(gateway)) < 2500
    (told,) = words(gateway, "/PSM1/warning")
    assert "more than 1500 messages per second from /console" in told


def test_ever_new_mistakes_are_not_quoted_for_ever(gateway: MemoryGateway) -> None:
    for count in range(20, 60):
        gateway.transport.send("/PSM1/servo_jp", joints(*[0.0] * count))
    assert len(words(gateway, "/PSM1/error")) == 8


def test_the_same_mistake_is_told_again_later_with_how_often_it_came(
    gateway: MemoryGateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [10**12]
    monkeypatch.setattr("devices.ros.topics.refusal_reports.monotonic_ns", lambda: now[0])
    for _ in range(5):
        gateway.transport.send("/PSM1/servo_jp", joints(0.0))
    now[0] += 2_000_000_000
    gateway.transport.send("/PSM1/servo_jp", joints(0.0))
    once, again = words(gateway, "/PSM1/error")
    assert "times" not in once
    assert again.endswith("(5 times)")


NOT_A_NUMBER, MANY = np.float64(np.nan).tobytes(), (10_000).to_bytes(4, "little")


@pytest.mark.parametrize(
    ("profile", "topic", "message", "told_on", "why"),
    [
        ("dvrk", "/endoscope/markers", b"\0\1\0\0" + MANY, "/endoscope/error", "allowed are at most 4000"),
        ("dvrk", "/endoscope/markers", MarkerArray(markers=[Marker()]), "/endoscope/error", "finite"),
        ("dvrk", "/stitch/pick", PointStamped(point=Point(x=1.0)), "/stitch/status", "finite"),
        ("vrep", "/stereo/markers", b"\0\1\0\0" + MANY, "/stereo/error", "allowed are at most 4000"),
        ("vrep", "/suture_planner/user_position", Pose(), "/stereo/error", "finite"),
    ],
)
def test_what_a_picture_cannot_show_is_refused_with_a_reason(
    tmp_path: Path, profile: str, topic: str, message: Message | bytes, told_on: str, why: str
) -> None:
    if isinstance(message, Message):
        message = encode(message).replace(np.float64(1.0).tobytes(), NOT_A_NUMBER)
    with make({"profile": profile, "stitching": True, "arms": {"PSM1": {}, "ECM": {}}}) as gateway:
        gateway.open(tmp_path)
        gateway.transport.send(topic, message)
        assert commands(gateway) == []
        assert why in " ".join(words(gateway, told_on))


class CrtkMove:
    """How a CRTK client waits for its move: for a newer operating state that is not busy."""

    def __init__(self, gateway: MemoryGateway) -> None:
        self._gateway, self._begun_ns = gateway, time_ns()

    @property
    def is_busy(self) -> bool:
        (*_, newest) = self._gateway.transport.heard("/PSM1/operating_state")
        assert isinstance(newest, OperatingState)
        return newest.header.stamp.ns <= self._begun_ns or newest.is_busy

    @property
    def reached(self) -> list[Message]:
        return self._gateway.transport.heard("/PSM1/goal_reached")


INVALID_MOVES = {
    "/PSM1/move_jp": (_cdr([np.nan, 0.0, 0.1, 0.0, 0.0, 0.0], []), joints(0.0), b"?"),
    "/PSM1/move_cp": (PoseStamped(pose=Pose(orientation=Quaternion(w=2.0))),),
    "/PSM1/jaw/move_jp": (joints(0.1, 0.2),),
}


@pytest.mark.parametrize(
    ("topic", "message"), [(topic, each) for topic, those in INVALID_MOVES.items() for each in those]
)
def test_a_client_stops_waiting_for_a_move_that_the_gateway_refuses(
    gateway: MemoryGateway, topic: str, message: Message | bytes
) -> None:
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True))
    move = CrtkMove(gateway)
    assert move.is_busy
    gateway.transport.send(topic, message)
    assert not move.is_busy
    assert [told.data for told in move.reached if isinstance(told, BoolMessage)] == [False]


def test_a_refused_move_ends_no_wait_for_one_that_is_under_way(gateway: MemoryGateway) -> None:
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True))
    move = CrtkMove(gateway)
    gateway.transport.send("/PSM1/move_jp", joints(*[0.1] * 6))
    gateway.transport.send("/PSM1/move_jp", joints(0.0))  # before the controller has begun the first
    assert move.is_busy
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True, is_busy=True))
    gateway.transport.send("/PSM1/move_jp", joints(0.0))
    assert move.is_busy
    assert move.reached == []
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True))
    assert not move.is_busy


def test_a_flood_of_refused_moves_is_not_passed_on(gateway: MemoryGateway) -> None:
    gateway.write("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True))
    for _ in range(1000):
        gateway.transport.send("/PSM1/move_jp", joints(0.0))
    assert len(gateway.transport.heard("/PSM1/operating_state")) < 400


def test_what_a_real_arm_says_comes_in_as_the_signals_are(gateway: MemoryGateway) -> None:
    stamp = Header(stamp=Time.from_ns(time_ns()))
    gateway.transport.send("/MTML/gripper/measured_js", JointState(header=stamp, position=np.array([0.3])))
    gateway.transport.send(
        "/MTML/measured_js",
        JointState(
            header=stamp, name=list("abcdefg"), position=np.zeros(7), velocity=np.zeros(7), effort=np.zeros(7)
        ),
    )
    gateway.transport.send("/MTML/measured_cp", PoseStamped())  # stamp 0: invalid
    (_, gripper), (_, measured) = commands(gateway)
    assert isinstance(gripper, JointState)
    assert (gripper.name, gripper.position.tolist(), gripper.velocity.tolist()) == (["gripper"], [0.3], [0.0])
    assert isinstance(measured, JointState)
    assert measured.name[0] == "outer_yaw"


def test_commands_go_to_a_real_arm(gateway: MemoryGateway) -> None:
    gateway.write("MTML/body/servo_cf", sample(gateway.transport.rows["/MTML/body/servo_cf"]))
    assert len(gateway.transport.heard("/MTML/body/servo_cf")) == 1


def test_the_status_tells_clients_and_rates(gateway: MemoryGateway) -> None:
    gateway.write("PSM1/measured_js", np.arange(18.0))
    gateway.transport.send("/PSM1/servo_jp", joints(0.0))
    first, *_ = [found.message for found in gateway.read(0) if found.port == "gateway"]
    assert isinstance(first, GatewayStatus)
    assert [found for found in gateway.read(500_000_000) if found.port == "gateway"] == []
    sleep(0.1)
    second = gateway.read(1_000_000_000)[-1].message
    assert isinstance(second, GatewayStatus)
    topics = {topic.topic: topic for topic in second.topics}
    assert 20 < topics["/PSM1/measured_js"].rate < 200
    assert (topics["/PSM1/servo_jp"].messages, topics["/PSM1/servo_jp"].refused) == (1, 1)
    assert "expected 6" in topics["/PSM1/servo_jp"].reason
    encode(second)


@pytest.mark.parametrize(
    ("said", "refused", "why"),
    [
        ("servo_jp refused: the arm is DISABLED, allowed in ENABLED and homed", 1, "the arm is DISABLED"),
        ("servo_jp refused: joint insertion at 0.9 m (3 times)", 3, "joint insertion at 0.9 m (to /console)"),
        ("servo_jp refused: more than were sent (9 times)", 4, "more than were sent"),
        ("state_command 'walk' is refused in state ENABLED", 1, "in state ENABLED"),
        ("move_jp refused: commanded by no program", 0, ""),
        ("jaw closed", 0, ""),
    ],
)
def test_the_status_counts_what_controllers_refuse(
    gateway: MemoryGateway, said: str, refused: int, why: str
) -> None:
    for _ in range(4):
        gateway.transport.send("/PSM1/servo_jp", joints(*[0.0] * 6))
    gateway.transport.send("/PSM1/state_command", StringStamped(string="walk"))
    gateway.write("PSM1/warning", (StringMessage(data=f"PSM1: {said}"),))
    (status,) = [found.message for found in gateway.read(0) if found.port == "gateway"]
    assert isinstance(status, GatewayStatus)
    counted = [topic for topic in status.topics if topic.refused]
    assert sum(topic.refused for topic in counted) == refused
    assert all(why in topic.reason for topic in counted)


def test_diagnostics_report_rates_and_the_age_of_the_snapshot(gateway: MemoryGateway) -> None:
    for k in range(250):  # 2.5 s of wall time or more, of which the simulation makes half at most
        gateway.write("PSM1/measured_js", np.arange(18.0))
        if k % 4 == 0:
            header = Header(stamp=Time.from_ns(10**9 + k * 5_000_000))
            gateway.write("endoscope/left/camera_info", CameraInfo(header=header))
            gateway.write("endoscope/left/image_raw", Image(header=header))
        sleep(0.01)
    _, first, second, *_ = gateway.transport.heard("/diagnostics")
    assert isinstance(first, DiagnosticArray)
    assert isinstance(second, DiagnosticArray)
    assert 0.7e9 < second.header.stamp.ns - first.header.stamp.ns < 10e9
    assert abs(second.header.stamp.ns - time_ns()) < 10e9
    found = {status.name: status for status in second.status}
    assert list(found) == ["ros: simulation", "ros: states", "ros: camera endoscope"]
    assert {status.level for status in second.status} == {0}
    values = {pair.key: float(pair.value) for status in second.status for pair in status.values}
    assert 20 < values["snapshots per second"] < 110
    assert 10 < values["slowest (Hz)"] < 110
    assert 5 < values["left/image_raw (Hz)"] < 30
    assert values["age of the snapshot (s)"] < 0.5
    assert 0.1 < values["real-time factor"] < 0.6


def test_diagnostics_without_a_simulation_are_stale(gateway: MemoryGateway) -> None:
    sleep(0.2)
    (told,) = gateway.transport.heard("/diagnostics")
    assert isinstance(told, DiagnosticArray)
    assert {status.level for status in told.status} == {3}


def test_a_transport_that_fails_is_told_where_the_device_is_read(
    gateway: MemoryGateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(value: object) -> bytes:
        raise OSError("the wire is cut")

    monkeypatch.setattr(gateway._states["PSM1/measured_js"], "cdr", fail)
    sleep(0.1)
    with pytest.raises(DeviceError, match="the wire is cut"):
        gateway.read(0)


def test_multi_arrays_pass(gateway: MemoryGateway) -> None:
    gateway.transport.send("/system/beep", Float64MultiArray(data=np.array([440.0, 0.2])))
    ((port, message),) = commands(gateway)
    assert port == "system/beep"
    assert isinstance(message, Float64MultiArray)
    assert message.data.tolist() == [440.0, 0.2]
