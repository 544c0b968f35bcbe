"""Keys and gamepad on SDL's driver without a screen; events are posted as SDL would."""

import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.keyboard.device import Keyboard, KeyboardParams
from devices.keyboard.keys import KEYS, wish_of
from devices.keyboard.virtual_stylus import VirtualStylus, Wish
from hub.testing import check_device
from robots import rotation
from schemas.errors import MissingExtraError

pygame = pytest.importorskip("pygame", reason="needs trocar[keyboard]")

MS = 1_000_000


@pytest.fixture(autouse=True)
def no_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    assert not pygame.display.get_init(), "what was opened is closed"


class Desk:
    """A keyboard device that is read at 250 Hz, and somebody who presses its keys."""

    def __init__(self, **params):
        self.device, self.t = Keyboard("keys", KeyboardParams.model_validate(params)), 0
        self.device.open(Path())

    def read(self, count=1):
        samples = []
        for _ in range(count):
            self.t += 4 * MS
            samples += self.device.read(self.t)
        self.all = [(s.port, s.message) for s in samples]
        return dict(self.all)

    def press(self, *keys, up=False):
        for key in keys:
            pygame.event.post(
                pygame.event.Event(pygame.KEYUP if up else pygame.KEYDOWN, key=pygame.key.key_code(key))
            )

    def focus(self, gained):
        pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSGAINED if gained else pygame.WINDOWFOCUSLOST))


@pytest.fixture
def desk():
    one = Desk()
    one.read()
    yield one
    one.device.close()


def test_the_contract_of_a_device():
    check_device(lambda: Keyboard("keys", KeyboardParams()))


def _numbers(pose):
    p, q = pose.pose.position, pose.pose.orientation
    return np.array([p.x, p.y, p.z]), rotation.matrix(np.array([q.x, q.y, q.z, q.w]))


def test_it_starts_level_and_at_rest(desk):
    got = desk.read()
    position, turn = _numbers(got["pose"])
    assert (position == 0.0).all()
    assert np.allclose(turn, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # columns: x right, y down, z ahead
    assert got["twist"].twist.linear.x == got["twist"].twist.angular.z == 0.0
    assert (got["gripper"].data, got["pose"].header.frame_id, got["pose"].header.stamp.ns) == (
        1.0,
        "keys_base",
        desk.t,
    )


WAYS = {"w": (0, 1), "s": (0, -1), "a": (1, 1), "d": (1, -1), "r": (2, 1), "f": (2, -1)}


@pytest.mark.parametrize("key", WAYS)
def test_a_held_key_moves_the_stylus(desk, key):
    axis, sign = WAYS[key]
    desk.press(key)
    got = desk.read(250)
    position, _ = _numbers(got["pose"])
    expected = np.zeros(3)
    expected[axis] = sign * 0.1
    assert np.allclose(position, expected, atol=1e-12)
    v = got["twist"].twist.linear
    assert np.allclose([v.x, v.y, v.z], expected)
    desk.press(key, up=True)
    assert np.allclose(_numbers(desk.read(10)["pose"])[0], expected, atol=1e-12)


TURNS = {"left": (2, 1), "right": (2, -1), "up": (1, -1), "down": (1, 1), "e": (0, 1), "q": (0, -1)}
"""About which axis of the base frame a level stylus turns: to the left about z, up about -y, a screw that
goes in about x.
"""


@pytest.mark.parametrize("key", TURNS)
def test_a_held_key_turns_the_stylus(desk, key):
    axis, sign = TURNS[key]
    _, before = _numbers(desk.read()["pose"])
    desk.press(key)
    got = desk.read(100)
    expected = np.zeros(3)
    expected[axis] = sign * 0.4
    assert np.allclose(_numbers(got["pose"])[1], rotation.matrix(rotation.exp(expected)) @ before, atol=1e-9)
    w = got["twist"].twist.angular
    assert np.allclose([w.x, w.y, w.z], expected / 0.4, atol=1e-9)


def test_what_stands_for_a_head_starts_and_turns_as_a_head_does():
    desk = Desk(stands_for="head")
    assert np.allclose(_numbers(desk.read()["pose"])[1], np.eye(3), atol=1e-12)
    desk.press("left", "w")
    got = desk.read(100)
    assert np.allclose(
        _numbers(got["pose"])[1], rotation.matrix(rotation.exp(np.array([0, 0, 0.4]))), atol=1e-9
    )
    assert (got["twist"].twist.angular.z, got["twist"].twist.linear.x) == (
        pytest.approx(1.0),
        pytest.approx(0.1),
    )
    desk.device.close()


def test_two_keys_are_no_faster_than_one(desk):
    desk.press("w", "a")
    v = desk.read()["twist"].twist.linear
    assert np.hypot(v.x, v.y) == pytest.approx(0.1)


def test_buttons_and_gripper(desk):
    assert "buttons" not in desk.read(5)
    desk.press("space", "c")
    desk.read(125)
    assert [list(m.buttons) for port, m in desk.all if port == "buttons"] == [[1, 1, 0, 0]]
    assert desk.all[-1][1].data == pytest.approx(0.5)
    desk.press("c", up=True)
    got = desk.read(3)
    assert (list(got["buttons"].buttons), got["gripper"].data) == ([1, 0, 0, 0], pytest.approx(0.5))
    desk.press("v")
    assert desk.read(300)["gripper"].data == 1.0
    desk.press("x", "z")
    assert list(desk.read(3)["buttons"].buttons) == [1, 0, 1, 1]


def test_out_of_focus_the_buttons_are_let_go_and_nothing_more_comes(desk):
    desk.press("w", "space")
    before, _ = _numbers(desk.read(10)["pose"])
    desk.focus(False)
    desk.read(50)
    assert [port for port, _ in desk.all] == ["buttons", "diagnostics"]
    assert list(desk.all[0][1].buttons) == [0, 0, 0, 0]
    assert "click into it" in desk.all[1][1].message
    desk.focus(True)
    got = desk.read(5)
    assert got["diagnostics"].level == 0
    assert "buttons" not in got
    assert (_numbers(got["pose"])[0] == before).all()


def test_a_stalled_reader_does_not_make_the_stylus_leap(desk):
    desk.press("w")
    desk.read()
    before, _ = _numbers(desk.read()["pose"])
    desk.t += 5_000 * MS
    after, _ = _numbers(desk.read()["pose"])
    assert after[0] - before[0] <= 0.1 * 0.1 + 1e-12


def test_without_a_screen_it_says_so_and_tries_again(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    desk = Desk()
    got = desk.read(50)
    assert list(got) == ["diagnostics"]
    assert "log in to a desktop" in got["diagnostics"].message
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert "pose" in desk.read(300)
    desk.device.close()


def test_a_driver_that_shows_nothing_is_no_screen(monkeypatch):
    monkeypatch.delenv("SDL_VIDEODRIVER")
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    assert "no screen" in Desk().read()["diagnostics"].message


@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends processes without asking them")
def test_a_process_with_a_window_ends_when_it_is_told_to():
    code = """
from pathlib import Path
import os, signal
from devices.keyboard.device import Keyboard, KeyboardParams
device = Keyboard("keys", KeyboardParams())
device.open(Path())
assert any(sample.port == "pose" for sample in device.read(0))
os.kill(os.getpid(), signal.SIGTERM)
"""
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, check=False, timeout=60).returncode
        == -signal.SIGTERM
    )


def test_one_window_a_process(desk):
    other = Desk()
    assert "a host of its own" in other.read()["diagnostics"].message
    desk.device.close()
    assert "pose" in other.read(300)
    other.device.close()


class Pad:
    """A gamepad as `pygame._sdl2.controller` has it."""

    def __init__(self, axes=(), buttons=()):
        self.axes, self.buttons, self.there = dict(axes), set(buttons), True

    def attached(self):
        return self.there

    def get_axis(self, axis):
        return self.axes.get(axis, 0)

    def get_button(self, button):
        return button in self.buttons


@pytest.fixture
def pad(monkeypatch):
    from devices.keyboard import gamepad

    one, module = (
        Pad(),
        SimpleNamespace(init=lambda: None, quit=lambda: None, is_controller=lambda number: True, count=1),
    )
    module.get_count, module.Controller = lambda: module.count, lambda number: one
    monkeypatch.setattr(gamepad, "controller", module)
    one.module = module
    return one


def test_a_gamepad_moves_the_stylus_too(pad):
    desk = Desk()
    desk.read()
    pad.axes = {
        pygame.CONTROLLER_AXIS_LEFTY: -32768,
        pygame.CONTROLLER_AXIS_LEFTX: 5000,
        pygame.CONTROLLER_AXIS_TRIGGERRIGHT: 32767,
    }
    pad.buttons = {
        pygame.CONTROLLER_BUTTON_LEFTSHOULDER,
        pygame.CONTROLLER_BUTTON_DPAD_RIGHT,
        pygame.CONTROLLER_BUTTON_RIGHTSHOULDER,
        pygame.CONTROLLER_BUTTON_A,
    }
    got = desk.read(25)
    v, w = got["twist"].twist.linear, got["twist"].twist.angular
    # the other axis is inside its dead zone
    assert np.allclose([v.x, v.y, v.z, w.x, w.y, w.z], [0.1, 0, 0, 1, 0, 0], atol=1e-9)
    assert got["gripper"].data == pytest.approx(0.9)
    assert list(dict(desk.all)["buttons"].buttons) == [1, 1, 1, 1]
    pad.there = False
    assert desk.read()["twist"].twist.linear.x == 0.0
    desk.device.close()


def test_a_gamepad_may_come_and_go(pad):
    pad.module.count = 0
    pad.axes = {pygame.CONTROLLER_AXIS_RIGHTX: 32767}
    desk = Desk()
    assert desk.read(2)["twist"].twist.angular.z == 0.0
    pad.module.count = 1
    pygame.event.post(pygame.event.Event(pygame.CONTROLLERDEVICEADDED))
    assert desk.read()["twist"].twist.angular.z == pytest.approx(-1.0)  # to the right
    desk.device.close()


@given(st.lists(st.sampled_from(sorted(KEYS)), max_size=8))
def test_no_keys_make_it_faster_than_it_may_be(keys):
    stylus = VirtualStylus(0.1, 1.0)
    for _ in range(3):
        stylus.advance(wish_of(keys), 0.1)
        linear, angular = stylus.twist
        assert np.linalg.norm(linear) <= 0.1 * (1 + 1e-12)
        assert np.linalg.norm(angular) <= 1.0 + 1e-12
        assert 0.0 <= stylus.gripper <= 1.0


def test_the_twist_is_the_rate_of_the_pose():
    stylus, wish, dt = VirtualStylus(0.1, 1.0), Wish(linear=(0.3, -0.2, 0.1), angular=(0.3, 0.4, -0.5)), 1e-4
    for _ in range(2000):
        before = stylus.pose
        stylus.advance(wish, dt)
    (p0, q0), (p1, q1), (v, w) = before, stylus.pose, stylus.twist
    assert np.allclose((np.array(p1) - p0) / dt, v, atol=1e-9)
    assert np.allclose(
        rotation.log(rotation.product(np.array(q1), rotation.conjugate(np.array(q0)))) / dt, w, atol=1e-4
    )


@pytest.mark.parametrize(
    ("key", "axis"), [("up", [0, -1, 0]), ("down", [0, 1, 0]), ("left", [0, 0, 1]), ("right", [0, 0, -1])]
)
def test_a_rolled_stylus_points_where_the_key_says(key, axis):
    stylus = VirtualStylus(0.1, 1.0)
    for wish in ("q", "up", "left"):
        stylus.advance(wish_of([wish]), 0.7)
    stylus.advance(wish_of([key]), 0.1)
    assert np.allclose(stylus.twist[1], axis)


def test_a_roll_turns_about_the_point_of_the_stylus():
    stylus = VirtualStylus(0.1, 1.0)
    stylus.advance(wish_of(["left"]), np.pi / 2)
    stylus.advance(wish_of(["e"]), 0.1)
    assert np.allclose(stylus.twist[1], [0, 1, 0])


def test_every_key_is_known_to_pygame():
    desk = Desk()
    desk.read()  # key names need the display
    assert {pygame.key.name(pygame.key.key_code(key)) for key in KEYS} == set(KEYS)
    desk.device.close()


def test_without_the_package_the_line_that_brings_it(monkeypatch):
    monkeypatch.setattr("devices.keyboard.device.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"trocar\[keyboard\]"):
        Keyboard("keys", KeyboardParams()).open(Path())


def test_ports_are_known_without_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    assert [port.name for port in Keyboard("keys", KeyboardParams()).ports] == [
        "pose",
        "twist",
        "buttons",
        "gripper",
        "diagnostics",
    ]
