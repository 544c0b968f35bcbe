"""Exercises every row of a gateway's table with a client of whatever middleware: what is told arrives as it
was told, what is said enters as it was said.

A client is a `Peer`; its messages are our models, so a client in another process is handed
`message.model_dump(mode="json")` and gives the like back.

    gateway = Ros2Dds("ros", Ros2Dds.params_model.model_validate(WHOLE)); gateway.open(tmp_path)
    peer.join(gateway.rows)
    exercise(gateway, peer)
    late = ...; check_late_joiner(gateway, late)
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from time import monotonic, sleep, time_ns
from typing import Any, Protocol

import numpy as np

from devices.ros.gateway import Gateway
from devices.ros.topics.row import Row
from hub.participant import Sample
from robots.dvrk.kinematics_queries import KinematicsQueries
from schemas.codec import encode, message_type
from schemas.crtk import (
    ForwardKinematicsRequest,
    ForwardKinematicsResponse,
    InverseKinematicsRequest,
    InverseKinematicsResponse,
)
from schemas.message import Message
from schemas.ros import Header, JointState, Pose, Quaternion, Time
from schemas.vectors import Vector, VectorCodec

__all__ = [
    "PYTHON_CLIENT",
    "WHOLE",
    "Peer",
    "check_late_joiner",
    "check_published",
    "check_served",
    "check_subscribed",
    "exercise",
    "sample",
    "without_stamp",
]

WHOLE: dict[str, Any] = {
    "arms": {
        "PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006"},
        "PSM2": {"instrument": "LARGE_NEEDLE_DRIVER_400006"},
        "PSM3": {"instrument": "CADIERE_FORCEPS_400049"},
        "ECM": {},
    },
    "mounting": "cart",
    "listen": ["MTML", "MTMR"],
    "teleoperations": ["MTMR_PSM1", "MTML_PSM2"],
}
"""Parameters of a gateway that shows all there is."""

_ARM = (
    *(
        "operating_state",
        "state_command",
        "setpoint_js",
        "setpoint_cp",
        "measured_js",
        "measured_cp",
        "measured_cv",
        "hold",
        "free",
    ),
    *(
        "servo_jp",
        "servo_jr",
        "servo_cp",
        "servo_jf",
        "move_jp",
        "move_jr",
        "move_cp",
        "forward_kinematics",
        "inverse_kinematics",
    ),
    *(f"{kind}/{name}" for kind in ("spatial", "body") for name in ("measured_cf", "servo_cf", "jacobian")),
    *(
        "local/measured_cp",
        "local/setpoint_cp",
        "local/forward_kinematics",
        "body/set_cf_orientation_absolute",
        "use_gravity_compensation",
    ),
    *("trajectory_j/set_ratio", "trajectory_j/ratio"),
)
_JAW = tuple(f"jaw/{name}" for name in ("measured_js", "setpoint_js", "servo_jp", "move_jp", "servo_jf"))
_SUJ = ("operating_state", "state_command", "measured_js", "measured_cp", "move_jp", "local/measured_cp")
PYTHON_CLIENT = frozenset(
    [f"/{arm}/{name}" for arm in ("PSM1", "PSM2", "PSM3", "ECM") for name in _ARM]
    + [f"/{arm}/{name}" for arm in ("PSM1", "PSM2", "PSM3") for name in (*_JAW, "emulate_tool_present")]
    + [f"/SUJ/{arm}/{name}" for arm in ("PSM1", "PSM2", "PSM3", "ECM") for name in _SUJ]
)
"""What programs made with dvrk_python and crtk_python_client (commits a1b337b3 and 33b4c387) expect a peer
for.
"""


class Peer(Protocol):
    """A ROS program."""

    def join(self, rows: Sequence[Row]) -> None:
        """Subscribe to rows that are published (as latched ones where they are), announce publishers of those
        subscribed to, and make clients of services; return once every one of them has found the gateway.
        """
        ...

    def send(self, row: Row, message: Message) -> None:
        """Publish a message."""
        ...

    def heard(self, row: Row, timeout_s: float) -> Message:
        """Return the next message of a topic that was not returned before; raises TimeoutError."""
        ...

    def call(self, row: Row, request: Message) -> Message:
        """Ask a service."""
        ...


def exercise(gateway: Gateway, peer: Peer, *, timeout_s: float = 60.0) -> None:
    """Exercise every row of an open gateway; `peer` has joined all of them."""
    check_published(gateway, peer, gateway.rows, timeout_s=timeout_s)
    check_subscribed(gateway, peer, gateway.rows, timeout_s=timeout_s)
    check_served(gateway, peer, gateway.rows)


def check_published(gateway: Gateway, peer: Peer, rows: Sequence[Row], *, timeout_s: float = 60.0) -> None:
    """What the simulation tells arrives as it was told, with wall-clock stamps."""
    told = {row.topic: _tell(gateway, row) for row in rows if row.way == "publish" and row.port is not None}
    begun_ns = time_ns()
    for row in rows:
        if row.topic not in told:
            continue
        message = _heard(gateway, row, peer, timeout_s)
        assert encode(without_stamp(message)) == encode(without_stamp(told[row.topic])), (
            f"{row.topic}: {message} was told as {told[row.topic]}"
        )
        stamp = _stamp(message)
        assert stamp is None or abs(stamp - begun_ns) < 600 * 10**9, (
            f"{row.topic}: stamp {stamp} is no wall time"
        )
        if row.periodic and stamp is not None:
            following = _stamp(_refreshed(gateway, row, peer, timeout_s))
            assert following is not None
            assert following > stamp, f"{row.topic}: stamps go from {stamp} to {following}"
    for row in rows:
        if row.way == "publish" and row.port is None and row.periodic:  # /tf, /joint_states
            _tell_states(gateway)
            assert _stamp(peer.heard(row, timeout_s)) != 0


def _tell(gateway: Gateway, row: Row) -> Message:
    """Let the simulation tell a sample on a row; return what programs are to get."""
    assert row.port is not None
    message = sample(row)
    if not row.periodic:
        gateway.write(row.port.name, message)
        return message
    codec = VectorCodec(row.port)
    value = _value(codec)
    gateway.write(row.port.name, value)
    return codec.to_message(value, 0)


def _tell_states(gateway: Gateway) -> None:
    for row in gateway.rows:
        if row.periodic and row.port is not None:
            codec = VectorCodec(row.port)
            gateway.write(row.port.name, _value(codec))


def _heard(gateway: Gateway, row: Row, peer: Peer, timeout_s: float) -> Message:
    """Return what was told on a row.

    Hundreds of messages at once are more than a busy machine may keep: an event that was lost is told again.
    """
    if row.periodic or row.latched:
        return peer.heard(row, timeout_s)
    wait_s = 1.0
    while wait_s < timeout_s:
        with suppress(TimeoutError):
            return peer.heard(row, wait_s)
        _tell(gateway, row)
        wait_s *= 2.0
    return peer.heard(row, timeout_s)


def _refreshed(gateway: Gateway, row: Row, peer: Peer, timeout_s: float) -> Message:
    """Return the next message of a state; a slow client is told again, as states are published for a second
    only.
    """
    _tell(gateway, row)
    return peer.heard(row, timeout_s)


def check_subscribed(gateway: Gateway, peer: Peer, rows: Sequence[Row], *, timeout_s: float = 60.0) -> None:
    """What a program says enters the simulation as it was said, and nothing is refused."""
    said = {
        row.port.name: (row, sample(row)) for row in rows if row.way == "subscribe" and row.port is not None
    }
    list(gateway.read(0))
    for row, message in said.values():
        peer.send(row, message)
    entered = {name: found.message for name, found in _read(gateway, set(said), timeout_s).items()}
    assert not said.keys() - entered.keys(), f"nothing came in on {sorted(said.keys() - entered.keys())}"
    for name, (row, message) in said.items():
        assert encode(entered[name]) == encode(message), f"{row.topic}: {message} came in as {entered[name]}"


def _read(gateway: Gateway, wanted: set[str], timeout_s: float) -> dict[str, Sample]:
    """Return the first message on each of the ports."""
    found: dict[str, Sample] = {}
    until = monotonic() + timeout_s
    while wanted - found.keys() and monotonic() < until:
        for said in gateway.read(0):
            found.setdefault(said.port, said)
        sleep(0.01)
    return found


def check_served(gateway: Gateway, peer: Peer, rows: Sequence[Row]) -> None:
    """Services answer as the kinematics does."""
    for row in (row for row in rows if row.way == "serve"):
        arm = gateway.params.arms.present_arms[row.owner]  # pyright: ignore[reportArgumentType]
        queries, home = KinematicsQueries(arm.chain), np.array(arm.start)
        base = (
            None
            if row.name.startswith("local/")
            else _value(VectorCodec(_port(gateway, f"SUJ/{row.owner}/measured_cp")))
        )
        if row.name == "inverse_kinematics":
            there = queries.forward(home)
            answer = _answer(gateway, peer, row, InverseKinematicsRequest(cp=_pose(there.value), jp=home))
            assert isinstance(answer, InverseKinematicsResponse)
            assert answer.result, answer.message
            np.testing.assert_array_equal(answer.jp, queries.inverse(there.value, home).value)
        else:
            answer = _answer(gateway, peer, row, ForwardKinematicsRequest(jp=home))
            assert isinstance(answer, ForwardKinematicsResponse)
            assert answer.result, answer.message
            np.testing.assert_array_equal(_numbers(answer.cp), queries.forward(home, base).value)
        refused = _answer(
            gateway,
            peer,
            row,
            (
                InverseKinematicsRequest(jp=np.zeros(9))
                if row.name == "inverse_kinematics"
                else ForwardKinematicsRequest(jp=np.zeros(9))
            ),
        )
        assert not getattr(refused, "result", True)
        assert "joints" in getattr(refused, "message", "")


def _answer(gateway: Gateway, peer: Peer, row: Row, request: Message) -> Message | None:
    """Return the answer to a request; states hold for a second, which a slow program may need to ask."""
    for _ in range(5):
        _tell_states(gateway)
        answer = peer.call(row, request)
        if "has no value now" not in getattr(answer, "message", ""):
            break
    return answer


def check_late_joiner(gateway: Gateway, late: Peer, *, timeout_s: float = 60.0) -> None:
    """A program that joins late gets the last message of every latched topic, and no older one."""
    latched = [row for row in gateway.rows if row.latched and row.port is not None]
    told = {row.topic: _tell(gateway, row) for row in latched}
    late.join(latched)
    for row in latched:
        message = late.heard(row, timeout_s)
        assert encode(without_stamp(message)) == encode(without_stamp(told[row.topic])), (
            f"{row.topic}: {message} was told as {told[row.topic]}"
        )


def sample(row: Row) -> Message:
    """Return a valid message of a row with something of its own in every field that programs look at, stamped
    now.
    """
    model = message_type(row.type)
    content: dict[str, Any] = {}
    if "header" in model.model_fields:
        content["header"] = Header(stamp=Time.from_ns(time_ns()), frame_id=row.owner.replace("/", "_"))
    if model is JointState:
        names = list(row.port.names) if row.port is not None else []
        numbers = 0.1 + 0.01 * np.arange(max(len(names), 1))
        stated = ("effort",) if row.name.endswith("_jf") else ("position", "velocity", "effort")
        content |= {"name": names} | dict.fromkeys(stated, numbers)
    content |= {name: value for name, value in _CONTENT.items() if name in model.model_fields}
    if "data" in model.model_fields:
        content["data"] = _DATA[row.type.rpartition("/")[2]]
    if model is Quaternion:
        content = _TURN.model_dump()
    return model.model_validate(content)


_TURN = Quaternion(x=0.5, y=-0.5, z=0.5, w=0.5)
_POSE = Pose.model_validate(
    {"position": {"x": 0.01, "y": -0.02, "z": 0.12}, "orientation": _TURN.model_dump()}
)
_MARKER = {
    "header": {"stamp": {"sec": 3, "nanosec": 4}, "frame_id": "PSM1_base"},
    "ns": "points",
    "id": -7,
    "type": 8,
    "pose": _POSE.model_dump(),
    "scale": {"x": 0.001, "y": 0.001, "z": 0.0},
    "color": {"r": 0.25, "g": 0.5, "b": 0.75, "a": 1.0},
    "lifetime": {"sec": 2, "nanosec": 500_000_000},
    "frame_locked": True,
    "points": [{"x": 0.01, "y": 0.02, "z": 0.03}, {"x": -0.01, "y": 0.0, "z": 0.0}],
    "colors": [{"r": 1.0, "a": 1.0}, {"b": 1.0, "a": 0.5}],
    "text": "a word",
}
_CONTENT: dict[str, Any] = {
    "markers": [_MARKER, {"action": 3}],
    "pose": _POSE,
    "quaternion": _TURN,
    "twist": {"linear": {"x": 0.1, "y": 0.2, "z": 0.3}, "angular": {"x": -0.1, "y": -0.2, "z": -0.3}},
    "wrench": {"force": {"x": 1.0, "y": 2.0, "z": 3.0}, "torque": {"x": 0.1, "y": 0.2, "z": 0.3}},
    "pose_is_valid": {"data": True},
    "state": "ENABLED",
    "is_homed": True,
    "string": "enable",
    "buttons": np.array([1], np.int32),
    "height": 2,
    "width": 3,
    "encoding": "rgb8",
    "step": 9,
    "format": "jpeg",
    "distortion_model": "plumb_bob",
    "force_position": {"x": 0.01, "y": 0.02, "z": 0.1},
}
_DATA: dict[str, Any] = {
    "Bool": True,
    "Float64": 0.25,
    "String": "a word",
    "Float64MultiArray": np.array([440.0, 0.2]),
    "Image": np.arange(18, dtype=np.uint8),
    "CompressedImage": np.arange(7, dtype=np.uint8),
}


def without_stamp(message: Message) -> Message:
    """Return a message with stamp 0."""
    header = getattr(message, "header", None)
    return (
        message.model_copy(update={"header": Header(frame_id=header.frame_id)})
        if isinstance(header, Header)
        else message
    )


def _stamp(message: Message) -> int | None:
    header = getattr(message, "header", None)
    return header.stamp.ns if isinstance(header, Header) else None


def _value(codec: VectorCodec) -> Vector:
    """Return a value of a signal with different numbers, valid as a pose if it is one."""
    value = 0.1 + 0.01 * np.arange(codec.size)
    if "pose.orientation" in codec.fields:
        value[3:] = _TURN.x, _TURN.y, _TURN.z, _TURN.w
    return value


def _port(gateway: Gateway, name: str) -> Any:
    return next(port for port in gateway.ports if port.name == name)


def _pose(value: Vector) -> Pose:
    x, y, z, qx, qy, qz, qw = value.tolist()
    return Pose.model_validate(
        {"position": {"x": x, "y": y, "z": z}, "orientation": {"x": qx, "y": qy, "z": qz, "w": qw}}
    )


def _numbers(pose: Pose) -> Vector:
    return np.array([*pose.position.model_dump().values(), *pose.orientation.model_dump().values()])
