"""OpenXR: the real loader and pyopenxr, with a runtime of our own behind them; nothing here is a real
headset.
"""

import ctypes
import json
from pathlib import Path

import numpy as np
import pytest

from devices.openxr.device import OpenXr, OpenXrParams, check
from devices.vendor_axes import vector
from hub.testing import check_device
from robots import rotation
from schemas.errors import MissingExtraError
from tests.devices.standins.build import USABLE, WHY_NOT, compile_library

pytest.importorskip("xr", reason="needs trocar[openxr]")
pytestmark = pytest.mark.skipif(not USABLE, reason=WHY_NOT)

MS = 1_000_000
STATE_CHANGED, INSTANCE_LOSS, USER_PRESENCE = 18, 17, 1000470000
READY, STOPPING, LOSS_PENDING, EXITING = 2, 6, 7, 8


class Standin(ctypes.Structure):
    _fields_ = [
        ("orientation", ctypes.c_float * 4),
        *((name, ctypes.c_float * 3) for name in ("position", "linear", "angular")),
        *((name, ctypes.c_uint64) for name in ("location_flags", "velocity_flags")),
        *(
            (name, ctypes.c_int32)
            for name in (
                "create_instance",
                "get_system",
                "create_session",
                "create_space",
                "locate",
                "convert",
            )
        ),
        *((name, ctypes.c_int32) for name in ("without_headless", "without_presence", "asleep")),
        *((name, ctypes.c_int32) for name in ("instances", "sessions", "running", "base", "wrong")),
        ("time", ctypes.c_int64),
    ]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return compile_library("xr.c", tmp_path_factory.mktemp("xr") / "libstandin_xr.so")


@pytest.fixture
def runtime(library, monkeypatch):
    """The stand-in, made the active runtime, as it was before anybody touched it; and how to send events."""
    loaded = ctypes.CDLL(str(library))
    standin = Standin.in_dll(loaded, "standin")
    fresh = bytes(standin)
    manifest = library.parent / "active_runtime.json"
    manifest.write_text(
        json.dumps({"file_format_version": "1.0.0", "runtime": {"library_path": str(library)}})
    )
    monkeypatch.setenv("XR_RUNTIME_JSON", str(manifest))
    standin.event = loaded.standin_event
    yield standin
    assert (standin.instances, standin.sessions, standin.wrong) == (
        0,
        0,
        0,
    ), "all is closed, and nothing was asked that may not be"
    ctypes.memmove(ctypes.addressof(standin), fresh, len(fresh))


class Reader:
    """A device that is read at 250 Hz."""

    def __init__(self, **params):
        self.device, self.t = OpenXr("head", OpenXrParams.model_validate(params)), 0
        self.device.open(Path())

    def __call__(self, count=1):
        samples = []
        for _ in range(count):
            self.t += 4 * MS
            samples += self.device.read(self.t)
        return [s.port for s in samples], {s.port: s.message for s in samples}


@pytest.fixture
def read(runtime):
    reader = Reader()
    yield reader
    reader.device.close()


def test_the_contract_of_a_device(runtime):
    check_device(lambda: OpenXr("head", OpenXrParams()))


def test_pose_and_twist_are_in_the_axes_of_rep_103(read, runtime):
    orientation = rotation.exp(np.array([0.1, 0.7, -0.2]))
    runtime.orientation[:], runtime.position[:] = orientation, (1.0, 2.0, 3.0)
    runtime.linear[:], runtime.angular[:] = (0.1, 0.2, 0.3), (0.4, 0.5, 0.6)
    ports, got = read()
    assert ports == ["diagnostics", "pose", "twist"]
    pose, twist = got["pose"].pose, got["twist"].twist
    assert (pose.position.x, pose.position.y, pose.position.z) == (-3.0, -1.0, 2.0)
    assert np.allclose([twist.linear.x, twist.linear.y, twist.linear.z], vector(0.1, 0.2, 0.3), atol=1e-7)
    assert np.allclose([twist.angular.x, twist.angular.y, twist.angular.z], vector(0.4, 0.5, 0.6), atol=1e-7)
    q = pose.orientation
    turn = rotation.matrix(np.array([q.x, q.y, q.z, q.w]))
    assert np.allclose(turn @ [1, 0, 0], vector(*(rotation.matrix(orientation) @ [0, 0, -1])), atol=1e-6)
    assert got["pose"].header.frame_id == "head_base"
    assert (got["diagnostics"].level, got["diagnostics"].hardware_id) == (0, "Stand-in, Scripted head")


def test_poses_are_of_now(read, runtime):
    read()
    before = runtime.time
    read()
    assert 0 < before < runtime.time


@pytest.mark.parametrize(("origin", "space"), [("eye", 2), ("floor", 3)])
def test_the_origin_is_at_the_eyes_or_on_the_floor(runtime, origin, space):
    reader = Reader(origin=origin)
    reader()
    reader.device.close()
    assert runtime.base == space


def test_a_pose_that_is_valid_but_not_tracked_is_a_pose(read, runtime):
    runtime.location_flags = 3
    assert read()[0] == ["diagnostics", "pose", "twist"]


@pytest.mark.parametrize("flags", [0, 1, 2, 12])
def test_a_pose_that_is_not_valid_is_none(read, runtime, flags):
    runtime.location_flags = flags
    ports, got = read(5)
    assert ports == ["diagnostics"]
    assert "not tracked" in got["diagnostics"].message
    runtime.location_flags = 15
    assert read()[0] == ["diagnostics", "pose", "twist"]


@pytest.mark.parametrize("flags", [0, 1, 2])
def test_what_the_runtime_does_not_know_of_the_velocity_is_taken_from_two_poses(read, runtime, flags):
    runtime.velocity_flags = flags
    runtime.linear[:], runtime.angular[:] = (9.0, 0.0, 0.0), (0.0, 9.0, 0.0)
    start = rotation.exp(np.array([0.2, -0.4, 0.6]))
    runtime.orientation[:], runtime.position[:] = start, (1.0, 1.0, 1.0)
    ports, _ = read()
    assert ports == ["diagnostics", "pose"]
    before = runtime.time
    turn, way = np.array([0.01, 0.02, -0.03]), np.array([0.001, -0.002, 0.003])
    runtime.orientation[:], runtime.position[:] = rotation.product(rotation.exp(turn), start), 1.0 + way
    ports, got = read()
    assert ports == ["pose", "twist"]
    dt, twist = (runtime.time - before) * 1e-9, got["twist"].twist
    linear = (9.0, 0.0, 0.0) if flags & 1 else way / dt
    angular = (0.0, 9.0, 0.0) if flags & 2 else turn / dt
    assert np.allclose([twist.linear.x, twist.linear.y, twist.linear.z], vector(*linear), rtol=1e-3)
    assert np.allclose([twist.angular.x, twist.angular.y, twist.angular.z], vector(*angular), rtol=1e-3)


def test_no_velocity_is_taken_across_a_gap(read, runtime):
    runtime.velocity_flags = 0
    read(3)
    runtime.location_flags = 0
    read()
    runtime.location_flags, runtime.position[0] = 3, 5.0
    assert read()[0] == ["diagnostics", "pose"]


def test_a_headset_that_sleeps_and_wakes(read, runtime):
    runtime.asleep = 1
    ports, got = read(5)
    assert ports == ["diagnostics"]
    assert "put the headset on" in got["diagnostics"].message
    for _ in range(2):
        runtime.event(STATE_CHANGED, READY)
        ports, got = read(3)
        assert (ports.count("pose"), got["diagnostics"].level, runtime.running) == (3, 0, 1)
        runtime.event(STATE_CHANGED, STOPPING)
        ports, got = read(3)
        assert (ports, got["diagnostics"].level, runtime.running) == (["diagnostics"], 1, 0)


@pytest.mark.parametrize("offered", [True, False])
def test_a_headset_that_is_taken_off(read, runtime, offered):
    runtime.without_presence = not offered
    read()
    runtime.event(USER_PRESENCE, 0)
    ports, got = read(3)
    assert ports == ["diagnostics"]
    assert "is not worn" in got["diagnostics"].message
    runtime.event(USER_PRESENCE, 1)
    assert read()[0] == ["diagnostics", "pose", "twist"]


ENDS = {
    "session lost": (STATE_CHANGED, LOSS_PENDING),
    "session ended": (STATE_CHANGED, EXITING),
    "runtime ends": (INSTANCE_LOSS, 0),
}


@pytest.mark.parametrize("end", ENDS)
def test_a_runtime_that_ends_is_looked_for_until_it_is_back(read, runtime, end):
    read()
    runtime.event(*ENDS[end])
    runtime.create_instance = -2
    ports, got = read(2)
    assert ports == ["diagnostics"]
    assert got["diagnostics"].level == 2
    assert (runtime.instances, runtime.sessions) == (0, 0)
    ports, got = read(600)
    assert ports == ["diagnostics"]
    assert "start one" in got["diagnostics"].message
    runtime.create_instance = 0
    ports, got = read(300)
    assert (got["diagnostics"].level, ports.count("diagnostics")) == (0, 1)
    assert ports.count("twist") >= 50


@pytest.mark.parametrize(
    ("call", "code", "message"),
    [
        ("create_instance", -2, "no OpenXR runtime answers"),
        ("get_system", -35, "FormFactorUnavailable"),
        ("create_session", -2, "refuses a session"),
        ("create_space", -31, "refuses a session"),
        ("locate", -17, "is lost"),
        ("locate", -13, "is lost"),
        ("convert", -2, "gives no time"),
    ],
)
def test_whatever_fails_is_told_and_tried_again(read, runtime, call, code, message):
    setattr(runtime, call, code)
    ports, got = read(3)
    assert ports == ["diagnostics"]
    assert message in got["diagnostics"].message
    assert (runtime.instances, runtime.sessions) == (0, 0)
    setattr(runtime, call, 0)
    assert read(300)[0].count("pose") >= 50


@pytest.mark.parametrize("call", ["locate", "convert"])
def test_a_runtime_that_does_not_know_the_time_yet_is_waited_for(read, runtime, call):
    setattr(runtime, call, -30)
    ports, got = read(3)
    assert ports == ["diagnostics"]
    assert "gives no time yet" in got["diagnostics"].message
    assert (runtime.instances, runtime.sessions) == (1, 1)
    setattr(runtime, call, 0)
    assert read()[0] == ["diagnostics", "pose", "twist"]


def test_a_runtime_that_wants_pictures_is_told_apart_until_another_one_is_active(read, runtime):
    runtime.without_headless = 1
    assert "does not offer XR_MND_headless" in read()[1]["diagnostics"].message
    runtime.without_headless = 0
    assert read(300)[0].count("pose") >= 50


def test_no_runtime_at_all(monkeypatch, tmp_path):
    monkeypatch.setenv("XR_RUNTIME_JSON", str(tmp_path / "nowhere.json"))
    reader = Reader()
    ports, got = reader(5)
    assert ports == ["diagnostics"]
    assert "no OpenXR runtime answers" in got["diagnostics"].message


def test_without_the_package_the_line_that_brings_it(monkeypatch):
    monkeypatch.setattr("devices.openxr.device.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"trocar\[openxr\]"):
        OpenXr("head", OpenXrParams()).open(Path())


@pytest.fixture
def forgotten(runtime):
    """The loader keeps the runtime that it has asked until an instance of it is destroyed."""

    def forget():
        reader = Reader()
        reader()
        reader.device.close()

    forget()
    yield
    runtime.without_headless = 0
    forget()


@pytest.mark.parametrize("case", ["works", "lacks", "absent", "not installed"])
def test_doctor_is_told_of_the_runtime_without_starting_it(forgotten, runtime, case, monkeypatch, tmp_path):
    runtime.without_headless = int(case == "lacks")
    with monkeypatch.context() as here:
        if case == "absent":
            here.setenv("XR_RUNTIME_JSON", str(tmp_path / "nowhere.json"))
        if case == "not installed":
            here.setattr("devices.openxr.device.find_spec", lambda name: None)
        works, detail, remedy = check()
    assert works == (case == "works")
    assert {
        "works": "gives poses",
        "lacks": "does not offer XR_MND_headless",
        "absent": "no OpenXR runtime answers",
    }.get(case, "pyopenxr") in detail
    assert ("trocar[openxr]" in remedy) == (case == "not installed")
