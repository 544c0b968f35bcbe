from itertools import pairwise
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from devices.simulated_touch.device import SimulatedTouch
from devices.simulated_touch.params import SimulatedTouchParams
from hub.participant import Sample
from hub.planning.scenario_file import load
from hub.testing import check_device
from schemas.codec import encode
from schemas.errors import MessageError, ScenarioError
from schemas.files import Files
from schemas.ros import DiagnosticStatus, Header, Joy, PoseStamped, Time, TwistStamped, Vector3, WrenchStamped
from schemas.trocar_msgs import ContactModel, ContactPlane

MS = 10**6
PRESS: list[dict[str, Any]] = [
    {"at": 0, "position": [0, 0, 0.02], "buttons": [0]},
    {"at": "1.2 s", "position": [0, 0, 0.02]},
    {"at": "1.8 s", "position": [0, 0, -0.01]},
]


def _device(path: list[dict[str, Any]] | str = PRESS, **params: Any) -> SimulatedTouch:
    device = SimulatedTouch(
        "touch",
        SimulatedTouchParams.model_validate(
            {"styluses": {"right": {"path": path, **params}}}, context=Files(Path.cwd()).context
        ),
    )
    device.open(Path())
    return device


def _table(time_ns: int, stiffness: float = 200.0) -> ContactModel:
    plane = ContactPlane(normal=Vector3(z=1.0), distance=0.0, stiffness=stiffness)
    return ContactModel(
        header=Header(stamp=Time.from_ns(time_ns), frame_id="touch_right_base"), planes=[plane]
    )


def _play(
    device: SimulatedTouch,
    until: float,
    *,
    period: int = 4 * MS,
    silent_from: float = 1e9,
    stiffness: float = 200.0,
) -> list[Sample]:
    """Meet the device every `period`: write what the simulation had for it, then read."""
    samples: list[Sample] = []
    for t in range(0, round(until * 1e9), period):
        if t < silent_from * 1e9:
            device.write("right/contact", _table(t, stiffness))
        samples += device.read(t)
    return samples


def _of(samples: list[Sample], port: str) -> list[Any]:
    return [sample.message for sample in samples if sample.port == f"right/{port}"]


def _heights(samples: list[Sample]) -> np.ndarray:
    return np.array([message.pose.position.z for message in _of(samples, "pose")])


def _forces(samples: list[Sample]) -> np.ndarray:
    return np.array([[m.wrench.force.x, m.wrench.force.y, m.wrench.force.z] for m in _of(samples, "force")])


def test_the_hand_rests_where_grip_and_table_balance() -> None:
    device = _device()
    samples = _play(device, 4.0)
    # a grip of 200 N/m wants to be 10 mm below a table of 200 N/m
    assert _heights(samples)[-1] == pytest.approx(-0.005, abs=1e-6)
    assert _forces(samples)[-1] == pytest.approx([0, 0, 1.0], abs=1e-4)


def test_the_force_is_the_one_of_the_safety_chain() -> None:
    device = _device([*PRESS[:2], {"at": "1.8 s", "position": [0, 0, -0.05]}], safety={"force": "0.7 N"})
    norms = np.linalg.norm(_forces(_play(device, 3.0, period=MS)), axis=1)
    assert norms.max() == pytest.approx(0.7)
    assert np.diff(norms).max() <= 0.1 + 1e-12


def test_without_the_button_there_is_no_force() -> None:
    device = _device([{**waypoint, "buttons": [1]} for waypoint in PRESS])
    samples = _play(device, 3.0)
    assert not _forces(samples).any()
    assert _heights(samples)[-1] == pytest.approx(-0.01, abs=1e-6)


def test_silence_ends_the_force() -> None:
    device = _device()
    samples = _play(device, 4.0, silent_from=3.0)
    forces = _forces(samples)[:, 2]
    assert forces[749] == pytest.approx(1.0, abs=1e-2)
    assert not forces[round(3.15 / 0.004) :].any()
    told = [(m.level, m.message.split(":")[0]) for m in _of(samples, "diagnostics")]
    assert told == [(0, "force is on"), (1, "no force")]


def test_it_moves_as_people_reach() -> None:
    device = _device(hand={"stiffness": "20 kN/m", "damping": "100 N*s/m"})
    samples = [sample for t in range(0, 2200 * MS, MS) for sample in device.read(t)]
    z, vz = _heights(samples), np.array([message.twist.linear.z for message in _of(samples, "twist")])
    assert z[1500] == pytest.approx(0.005, abs=2e-4)  # half way in half the time
    assert np.abs(vz).max() == pytest.approx(1.875 * 0.03 / 0.6, rel=0.02)
    assert np.gradient(z, 1e-3)[1:-1] == pytest.approx(vz[1:-1], abs=2e-3)


def test_orientation_follows_the_path_and_the_twist_is_its_rate() -> None:
    path = [{"at": 0}, {"at": "1 s", "orientation": [0, 0, 0, 1]}]
    device = _device(path)
    samples = [sample for t in range(0, 1001 * MS, MS) for sample in device.read(t)]
    poses, twists = _of(samples, "pose"), _of(samples, "twist")
    first, last = (np.array([getattr(poses[i].pose.orientation, axis) for axis in "xyzw"]) for i in (0, -1))
    assert first == pytest.approx([-0.5, 0.5, -0.5, 0.5])
    assert np.abs(last) == pytest.approx([0, 0, 0, 1])
    turned = sum(hypot(m.twist.angular.x, m.twist.angular.y, m.twist.angular.z) for m in twists) * 1e-3
    assert turned == pytest.approx(2 * np.pi / 3, rel=1e-4)


def test_buttons_tell_of_every_change_once() -> None:
    path = [
        {"at": 0},
        {"at": "10.5 ms", "buttons": [0, 1]},
        {"at": "12 ms", "buttons": []},
        {"at": "50 ms", "buttons": [1]},
    ]
    device = _device(path)
    joys: list[Joy] = _of([sample for t in (0, 40 * MS, 80 * MS) for sample in device.read(t)], "buttons")
    assert [(joy.header.stamp.ns // MS, joy.buttons.tolist()) for joy in joys] == [
        (0, [0, 0]),
        (11, [1, 1]),
        (12, [0, 0]),
        (50, [0, 1]),
    ]


@given(st.lists(st.integers(0, 100 * MS), max_size=20))
def test_how_often_it_is_read_changes_nothing(times: list[int]) -> None:
    """Without a contact model; with one, the times at which it arrives do matter."""
    path = [
        {"at": 0},
        {"at": "20 ms", "position": [0.01, 0, 0], "buttons": [0]},
        {"at": "70 ms", "position": [0, 0, 0], "buttons": [1]},
    ]
    at_once, in_parts = _device(path), _device(path)
    whole = at_once.read(100 * MS)
    parts = [sample for t in [*sorted(times), 100 * MS] for sample in in_parts.read(t)]
    assert [encode(s.message) for s in parts[-3:]] == [encode(s.message) for s in whole[-3:]]
    events = {"right/buttons", "right/diagnostics"}
    assert [encode(s.message) for s in parts if s.port in events] == [
        encode(s.message) for s in whole if s.port in events
    ]


def test_a_contact_model_is_felt_from_the_time_at_which_it_was_written() -> None:
    """Between two meetings the hand has only the model before."""
    path = [{"at": 0, "position": [0, 0, -0.0009], "buttons": [0]}]
    often, once = _device(path), _device(path)
    _play(often, 1.5, period=100 * MS)  # up to 1.4 s; less than 0.2 N, so the force comes in
    _play(once, 1.5, period=100 * MS)
    before = _forces(often.read(1499 * MS))[0, 2]
    for device in (often, once):
        device.write("right/contact", _table(1500 * MS, stiffness=400.0))
    then, at_once = (_forces(device.read(1500 * MS))[0, 2] for device in (often, once))
    assert before < 0.12 < then
    assert at_once == then


def test_opened_again_it_starts_again_and_gives_the_same_bits() -> None:
    device = _device()
    runs: list[list[bytes]] = []
    for _ in range(2):
        device.open(Path())
        runs.append([encode(sample.message) for sample in _play(device, 2.0)])
    assert runs[0] == runs[1]


def test_it_keeps_the_contract_of_a_device() -> None:
    check_device(_device, inputs={"right/contact": _table(0)})


def test_ports_are_those_of_a_stylus() -> None:
    ports = {port.name: port for port in _device().ports}
    assert {n: p.type for n, p in ports.items()} == {
        "right/pose": PoseStamped.ros_type,
        "right/twist": TwistStamped.ros_type,
        "right/buttons": Joy.ros_type,
        "right/force": WrenchStamped.ros_type,
        "right/diagnostics": DiagnosticStatus.ros_type,
        "right/contact": ContactModel.ros_type,
    }
    assert {p.clock for p in ports.values()} == {"simulated"}
    assert {p.frame for n, p in ports.items() if n != "right/diagnostics"} == {"touch_right_base"}
    assert ports["right/pose"].max_age_ns == 100 * MS


@pytest.mark.parametrize(
    ("params", "problem"),
    [
        ({"path": []}, "at least one waypoint"),
        ({"path": [{"at": "1 s"}, {"at": "1 s"}]}, "go forward"),
        ({"path": [{"at": 0, "buttons": [2]}]}, "buttons 0 and 1"),
        ({"safety": {"force": "2 N"}}, "device's limit is 1.98 N"),
        ({"safety": {"force": "2.1 N"}}, "less than or equal to 2"),
        ({"safety": {"stiffness": "1 kN/m"}}, "less than or equal to 400"),
        ({"safety": {"silence": "1 s"}}, "less than or equal to"),
        ({"hand": {"mass": 0}}, "greater than 0"),
        ({"dead_man": 3}, "less than or equal to 1"),
    ],
)
def test_parameters_out_of_range(params: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        _device(**{"path": PRESS, **params})


def test_only_contact_models_are_taken() -> None:
    with pytest.raises(MessageError, match="'right/contact'; this is a Header on 'right/pose'"):
        _device().write("right/pose", Header())


def test_stamps_of_late_reads_go_forward() -> None:
    device = _device()
    stamps = [
        s.message.header.stamp.ns
        for t in (0, MS // 2, 3 * MS // 2, 9 * MS)
        for s in device.read(t)
        if s.port == "right/pose"
    ]
    assert stamps == [0, MS, 9 * MS]
    assert all(a < b for a, b in pairwise(stamps))


def test_a_misspelt_word_deep_in_a_scenario_is_told_with_the_right_one(tmp_path: Path) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_text(
        "name: a\nstep: 1 ms\nparticipants:\n  touch: {kind: simulated-touch, styluses: {right: {path: [{at:"
        " 0, bottons: [0]}]}}}\n"
    )
    with pytest.raises(ScenarioError) as refused:
        load(str(file))
    (line,) = str(refused.value).splitlines()
    assert line.startswith(f"{file}:4:")
    assert line.endswith(
        "there is no 'bottons' here. Did you mean 'buttons'? Known: at, buttons, orientation, position."
    )


def test_a_hand_too_fast_has_no_force_until_it_lets_go_and_the_diagnosis_says_so() -> None:
    path = [
        {"at": 0, "position": [0, 0, 0.2], "buttons": [0]},
        {"at": "0.1 s", "position": [0, 0, 0.02]},  # 3 m/s
        {"at": "1.5 s", "position": [0, 0, -0.01]},
        {"at": "2 s", "position": [0, 0, 0.02], "buttons": []},
        {"at": "2.1 s", "buttons": [0]},
        {"at": "3.5 s"},
        {"at": "4 s", "position": [0, 0, -0.01]},
    ]
    samples = _play(_device(path, safety={"passivity": True}), 4.5)
    forces = np.linalg.norm(_forces(samples), axis=1)
    assert not forces[:500].any()
    assert forces[-1] == pytest.approx(1.0, abs=0.01)
    told = [message.message for message in _of(samples, "diagnostics")]
    assert [text.partition(";")[0] for text in told] == [
        "force is on",
        "no force: the hand was too fast",
        "no force: the dead-man is not held",
        "force is on",
    ]
