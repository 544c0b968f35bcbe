"""LibOVR against a library of our own with the layouts of its header; nothing here is a real headset."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from devices.headset import Headset
from devices.libovr import api
from devices.libovr.device import LibOvr, LibOvrParams
from devices.vendor_axes import vector
from hub.testing import check_device
from robots import rotation
from schemas.errors import DeviceError
from tests.devices.standins.build import USABLE, WHY_NOT, compile_library

pytestmark = pytest.mark.skipif(not USABLE, reason=WHY_NOT)
MS = 1_000_000


class Status(ctypes.Structure):
    _fields_ = [
        (name, ctypes.c_byte)
        for name in ("visible", "present", "mounted", "lost", "quit", "recenter", "focus", "overlay", "depth")
    ]


class Standin(ctypes.Structure):
    _fields_ = [
        ("orientation", ctypes.c_float * 4),
        ("position", ctypes.c_float * 3),
        ("angular", ctypes.c_float * 3),
        ("linear", ctypes.c_float * 3),
        ("accelerations", ctypes.c_float * 6),
        ("pad", ctypes.c_byte * 4),
        ("time", ctypes.c_double),
        ("tracked", ctypes.c_uint32),
        ("status", Status),
        *((name, ctypes.c_int32) for name in ("initialize", "create", "session", "recenter")),
        ("flags", ctypes.c_uint32),
        ("minor", ctypes.c_uint32),
        *((name, ctypes.c_int32) for name in ("initialized", "sessions", "recentered", "origin")),
    ]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return compile_library("ovr.c", tmp_path_factory.mktemp("ovr") / "libOVRRT64.so.1")


@pytest.fixture
def head(library):
    """The stand-in, as it was before anybody touched it."""
    standin = Standin.in_dll(ctypes.CDLL(str(library)), "standin")
    fresh = bytes(standin)
    yield standin
    assert (standin.initialized, standin.sessions) == (0, 0), "what was opened is closed"
    ctypes.memmove(ctypes.addressof(standin), fresh, len(fresh))


@pytest.fixture
def make(library, head):
    made: list[Headset] = []

    def device(**params) -> LibOvr:
        made.append(LibOvr("head", LibOvrParams.model_validate({"library": str(library), **params})))
        made[-1].open(Path())
        return made[-1]

    yield device
    for one in made:
        one.close()


class Reader:
    """Reads at 250 Hz, a new state of the head each time."""

    def __init__(self, device, head):
        self.device, self.head, self.t = device, head, 0

    def __call__(self, *, moves=True, count=1):
        samples = []
        for _ in range(count):
            self.t += 4 * MS
            self.head.time += 0.004 if moves else 0.0
            samples += self.device.read(self.t)
        return [s.port for s in samples], {s.port: s.message for s in samples}


def test_the_contract_of_a_device(library, head):
    check_device(lambda: LibOvr("head", LibOvrParams(library=library)))


def test_the_library_is_asked_as_the_sdk_does(make, head):
    make().read(0)
    assert (head.flags, head.minor, head.origin) == (0x4 | 0x10, 32, 0)
    make(origin="floor").read(0)
    assert head.origin == 1


def test_without_a_requested_version_the_library_refuses(library, head):
    assert (
        api.load(str(library)).ovr_Initialize(
            ctypes.byref(api.InitParams(Flags=api.INVISIBLE, RequestedMinorVersion=32))
        )
        == -1005
    )


def test_pose_and_twist_are_in_the_axes_of_rep_103(make, head):
    orientation, w = rotation.exp(np.array([0.1, 0.7, -0.2])), np.array([0.3, -0.4, 0.5])
    head.orientation[:], head.position[:] = orientation, (1.0, 2.0, 3.0)
    head.linear[:], head.angular[:] = (0.1, 0.2, 0.3), w
    _, got = Reader(make(), head)()
    pose, twist = got["pose"].pose, got["twist"].twist
    assert (pose.position.x, pose.position.y, pose.position.z) == (-3.0, -1.0, 2.0)
    assert np.allclose([twist.linear.x, twist.linear.y, twist.linear.z], [-0.3, -0.1, 0.2], atol=1e-7)
    q = pose.orientation
    turn, vendor = rotation.matrix(np.array([q.x, q.y, q.z, q.w])), rotation.matrix(orientation)
    assert np.allclose(turn @ [1, 0, 0], vector(*(vendor @ [0, 0, -1])), atol=1e-6)
    assert np.allclose([twist.angular.x, twist.angular.y, twist.angular.z], vector(*w), atol=1e-6)
    assert got["pose"].header.frame_id == got["twist"].header.frame_id == "head_base"
    assert got["pose"].header.stamp.ns == 4 * MS
    assert (got["diagnostics"].level, got["diagnostics"].hardware_id) == (0, "Oculus Rift CV1 STANDIN")


@pytest.mark.parametrize("frame", ["base", "head"])
def test_the_angular_velocity_may_be_along_either_frame(make, head, frame):
    head.orientation[:], head.angular[:] = rotation.exp(np.array([0.0, np.pi / 2, 0.0])), (0.0, 0.0, -0.5)
    # looks left and rolls about what is ahead in that frame
    _, got = Reader(make(angular_velocity=frame), head)()
    w = got["twist"].twist.angular
    assert np.allclose([w.x, w.y, w.z], [0.5, 0, 0] if frame == "base" else [0, 0.5, 0], atol=1e-6)


NOT_SEEN = {
    "worn": ({"status.mounted": 0}, "is not worn"),
    "unplugged": ({"status.present": 0}, "unplugged"),
    "untracked": ({"tracked": 1}, "not tracked"),
    "dark": ({"tracked": 0}, "not tracked"),
    "lost": ({"status.lost": 1}, "ended the session"),
    "quit": ({"status.quit": 1}, "ended the session"),
    "dead": ({"session": -1002}, "lost"),
    "no quaternion": ({"orientation": (0, 0, 0, 0)}, "no unit quaternion"),
    "not a number": ({"position": (float("nan"), 0, 0)}, "no pose"),
}


@pytest.mark.parametrize("case", NOT_SEEN)
def test_a_head_that_is_not_there_gives_no_samples_says_so_once_and_comes_back(make, head, case):
    changes, message = NOT_SEEN[case]
    read = Reader(make(), head)
    assert read()[0] == ["diagnostics", "pose", "twist"]
    before = {name: _get(head, name) for name in changes}
    for name, value in changes.items():
        _set(head, name, value)
    ports, got = read(count=5)
    assert ports == ["diagnostics"]
    assert message in got["diagnostics"].message
    assert got["diagnostics"].level > 0
    for name, value in before.items():
        _set(head, name, value)
    ports, got = read(count=300)
    assert got["diagnostics"].level == 0
    assert ports.count("diagnostics") == 1
    assert ports.count("pose") == ports.count("twist") >= 50


def _get(head, name):
    for part in name.split("."):
        head = getattr(head, part)
    return tuple(head) if isinstance(head, ctypes.Array) else head


def _set(head, name, value):
    *path, last = name.split(".")
    for part in path:
        head = getattr(head, part)
    if isinstance(value, tuple):
        getattr(head, last)[:] = value
    else:
        setattr(head, last, value)


@pytest.mark.parametrize(
    ("call", "code", "message"), [("initialize", -3000, "start the Oculus"), ("create", -1007, "plug it in")]
)
def test_no_runtime_or_no_headset_is_looked_for_again(make, head, call, code, message):
    setattr(head, call, code)
    read = Reader(make(), head)
    ports, got = read(count=600)
    assert ports == ["diagnostics"]
    assert message in got["diagnostics"].message
    assert f"as the test ordered, {code}" in got["diagnostics"].message
    assert head.initialized == head.sessions == 0
    setattr(head, call, 0)
    assert "pose" in read(count=300)[0]


def test_a_runtime_that_stands_still_gives_nothing_and_says_so(make, head):
    read = Reader(make(), head)
    read()
    ports, got = read(moves=False, count=50)
    assert ports == ["diagnostics"]
    assert (got["diagnostics"].level, "no new poses" in got["diagnostics"].message) == (3, True)
    assert read()[0] == ["diagnostics", "pose", "twist"]


def test_the_origin_is_taken_where_the_head_is_first_seen(make, head):
    head.position[:], head.status.mounted = (1.0, 1.0, 1.0), 0
    read = Reader(make(recenter=True), head)
    read(count=3)
    assert head.recentered == 0
    head.status.mounted, head.recenter = 1, -1000
    assert "hold the head level" in read()[1]["diagnostics"].message
    head.recenter = 0
    _, got = read(count=5)
    assert (head.recentered, got["pose"].pose.position.x) == (1, 0.0)


def test_the_wearer_may_ask_for_a_new_origin(make, head):
    read = Reader(make(), head)
    read(count=3)
    assert head.recentered == 0
    head.status.recenter = 1
    read(count=3)
    assert head.recentered == 1


def test_no_more_samples_than_were_asked_for(make, head):
    device = make(rate=100)
    ports = []
    for t in range(1000):
        head.time += 0.001
        ports += [sample.port for sample in device.read(t * MS)]
    assert ports.count("pose") == 100


def test_a_wrong_library_is_an_error_and_a_missing_one_a_diagnosis(tmp_path):
    with pytest.raises(DeviceError, match=r"nowhere\.so"):
        LibOvr("head", LibOvrParams(library="nowhere.so")).open(tmp_path)
    other = compile_library("nothing.c", tmp_path / "nothing.so")
    with pytest.raises(DeviceError, match="ovr_Initialize"):
        LibOvr("head", LibOvrParams(library="nothing.so")).open(other.parent)
    device = LibOvr("head", LibOvrParams())
    device.open(tmp_path)
    (sample,) = device.read(0)
    assert "install the Oculus" in sample.message.message


def test_doctor_is_told_of_the_library(library, monkeypatch):
    works, detail, remedy = api.check()
    assert not works
    assert "libOVRRT64" in detail
    assert "install" in remedy
    monkeypatch.setattr(api, "default_library", lambda: str(library))
    assert api.check()[:2] == (True, "1.32.0-standin: headsets of Oculus")
