"""Kind `touch` with its servo process and the stand-in of HDAPI, on good days and bad ones.

In wall time: each wait ends as soon as it can.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from devices.haptics.servo.exchange import create, memory_size
from devices.openhaptics.device import Touch
from devices.openhaptics.hdapi import Code
from devices.openhaptics.params import TouchParams
from hub.participant import Sample
from hub.testing import check_device
from schemas.errors import DeviceError, MessageError
from schemas.ros import DiagnosticStatus, Joy, PoseStamped, WrenchStamped
from schemas.trocar_msgs import ContactModel
from tests.devices.standins import build, host
from tests.devices.standins.hd import NEEDS_MANUAL_INPUT, VARIABLE, HdWorld, Row
from tests.waiting import LIMIT_S

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

PATIENCE_S = LIMIT_S
"""Of a test whose machine has no time for it; what is waited for takes some tenths of a second."""
LIVING = "import time; print(flush=True); time.sleep(60)"


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build.compile_library("hd.c", tmp_path_factory.mktemp("hd") / "libHD.so")


@pytest.fixture
def world(library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> HdWorld:
    made = HdWorld(library, tmp_path / "world")
    monkeypatch.setenv(VARIABLE, str(made.file))
    return made


class Hands:
    """A device that is read and written to as a host does it."""

    def __init__(self, touch: Touch) -> None:
        self.touch = touch
        self.samples: dict[str, list[Any]] = {port.name: [] for port in touch.ports}
        self._start = monotonic_ns()

    def until(self, fulfilled: Callable[[], bool], *, touching: bool = True) -> None:
        """Go on until it is so."""
        end = monotonic() + PATIENCE_S
        while not fulfilled():
            assert monotonic() < end, self.told()
            now = monotonic_ns() - self._start
            for sample in self.touch.read(now):
                self.samples[sample.port].append(sample.message)
            for port in (p.name for p in self.touch.ports if p.causality == "input"):
                if touching:
                    self.touch.write(port, host.floor(now, 1))
            sleep(0.002)

    def forget(self) -> None:
        for messages in self.samples.values():
            messages.clear()

    def told(self, stylus: str = "right") -> list[str]:
        return [message.message for message in self.samples[f"{stylus}/diagnostics"]]

    def has_told(self, words: str, stylus: str = "right") -> bool:
        return any(words in text for text in self.told(stylus))

    def gives(self, stylus: str = "right") -> bool:
        return bool(self.samples[f"{stylus}/pose"])

    def force(self, stylus: str = "right") -> float:
        messages: list[WrenchStamped] = self.samples[f"{stylus}/force"]
        return messages[-1].wrench.force.z if messages else 0.0


@pytest.fixture
def hands(library: Path, world: HdWorld, tmp_path: Path) -> Iterator[Callable[..., Hands]]:
    opened: list[Touch] = []

    def open_touch(**styluses: dict[str, Any]) -> Hands:
        params = {"library": str(library), "styluses": styluses or {"right": {}, "left": {"device": "left"}}}
        touch = Touch("touch", TouchParams.model_validate(params))
        opened.append(touch)
        touch.open(tmp_path)
        return Hands(touch)

    yield open_touch
    for touch in opened:
        touch.close()


def _press(world: HdWorld, hands: Hands, *styluses: str) -> None:
    """Bring the hands into the contact, from above, until they feel it; again, if a busy machine was silent
    for so long that the force went.
    """
    while not all(hands.force(s) > 1.2 for s in styluses):
        for device in world.devices:
            device.buttons, device.target[1] = 1, 0.03
        hands.until(lambda: all(hands.told(s)[-1:] == ["force is on"] for s in styluses))
        for device in world.devices:
            device.target[1] = -0.005
        tried = monotonic()
        hands.until(lambda: all(hands.force(s) > 1.2 for s in styluses) or monotonic() > tried + 3.0)  # noqa: B023 - called before the next turn


def test_it_keeps_the_contract_of_a_device(library: Path, world: HdWorld) -> None:
    params = {
        "library": str(library),
        "styluses": {
            "right": {"dead_man": "safety-switch"},
            "left": {"device": "left", "safety": {"force": "1 N"}},
        },
    }
    check_device(lambda: Touch("touch", TouchParams.model_validate(params)))


def test_pose_buttons_and_diagnosis(world: HdWorld, hands: Callable[..., Hands]) -> None:
    one = hands()
    one.until(lambda: one.gives() and one.gives("left"))
    world.devices[0].target[0] = 0.01
    one.until(lambda: one.samples["right/pose"][-1].pose.position.y < -0.0099)
    pose: PoseStamped = one.samples["right/pose"][-1]
    assert pose.header.frame_id == "touch_right_base"
    assert pose.pose.position.x == pytest.approx(0.039)  # of the tip: the stylus points away from the user
    q = pose.pose.orientation
    assert abs(np.array([q.x, q.y, q.z, q.w]) @ (-0.5, 0.5, -0.5, 0.5)) == pytest.approx(1.0)
    for pressed in (1, 3, 0):
        world.devices[0].buttons = pressed
        count = len(one.samples["right/buttons"])
        one.until(lambda count=count: len(one.samples["right/buttons"]) > count)
    joys: list[Joy] = one.samples["right/buttons"]
    assert [joy.buttons.tolist() for joy in joys] == [[0, 0], [1, 0], [1, 1], [0, 0]]
    assert one.has_told("the dead-man is not held")
    diagnosis: DiagnosticStatus = one.samples["right/diagnostics"][-1]
    assert (diagnosis.name, diagnosis.hardware_id) == ("touch/right", "Touch STANDIN-0")


def test_a_short_click_is_not_lost_while_the_host_is_busy(
    world: HdWorld, hands: Callable[..., Hands]
) -> None:
    one = hands()
    one.until(lambda: bool(one.samples["right/buttons"]))
    world.devices[0].buttons = 1
    sleep(0.015)
    world.devices[0].buttons = 0
    sleep(0.015)
    one.until(lambda: len(one.samples["right/buttons"]) >= 3)
    assert [joy.buttons.tolist() for joy in one.samples["right/buttons"]] == [[0, 0], [1, 0], [0, 0]]


@pytest.mark.long
def test_a_stylus_that_is_unplugged_and_plugged_in_again(world: HdWorld, hands: Callable[..., Hands]) -> None:
    one = hands()
    _press(world, one, "right", "left")
    world.devices[0].plugged = 0
    one.until(lambda: one.has_told("it has failed (HD_COMM_ERROR (0x0302)): see to its cable and power"))
    assert one.force() == 0.0
    one.forget()
    one.until(lambda: one.gives("left") and one.force("left") == 0.0)  # its process was replaced
    world.devices[0].plugged = 1
    one.until(lambda: one.has_told("it is back, and is used as soon as no other hand"))
    one.forget()
    one.until(lambda: len(one.samples["left/pose"]) > 100)
    assert not one.gives()  # as long as the other hand holds its dead-man it is not disturbed
    world.devices[1].buttons = 0
    one.until(one.gives)


@pytest.mark.parametrize(
    ("silent", "words"),
    [
        (0, "another program uses it (HD_TIMER_ERROR (0x0304))"),
        (1, "another program uses it: end that program"),
    ],
)
def test_another_program_has_the_stylus(
    world: HdWorld, hands: Callable[..., Hands], silent: int, words: str
) -> None:
    with subprocess.Popen([sys.executable, "-c", LIVING], stdout=subprocess.PIPE) as other:
        assert other.stdout
        other.stdout.readline()
        world.devices[0].owner, world.devices[0].silent = other.pid, silent
        one = hands(right={})
        one.until(lambda: one.has_told(words))
        assert not one.gives()
        other.kill()
        other.communicate()
    one.until(one.gives)


def test_a_stylus_that_is_not_calibrated(world: HdWorld, hands: Callable[..., Hands]) -> None:
    world.devices[0].calibration = NEEDS_MANUAL_INPUT
    one = hands(right={})
    one.until(lambda: one.has_told("it is not calibrated: put the stylus into the inkwell"))
    assert not one.gives()
    world.devices[0].inkwell = 1
    one.until(one.gives)


def test_a_storm_of_warnings_is_told_once(world: HdWorld, hands: Callable[..., Hands]) -> None:
    one = hands(right={"safety": {"passivity": True}})
    _press(world, one, "right")
    one.forget()
    world.devices[0].error, world.devices[0].error_frames = Code.WARM_MOTORS, 300
    one.until(lambda: world.devices[0].error_frames == 0)
    assert one.told() == ["no force: the device warns of HD_WARM_MOTORS (0x0200); let its motors cool"]
    assert one.force() == 0.0
    assert one.gives()
    world.devices[0].target[1] = 0.03
    one.until(lambda: one.told()[-1] == "force is on")


@pytest.mark.parametrize(
    ("blow", "words"),
    [
        (signal.SIGKILL, "the servo process has ended"),
        (signal.SIGTERM, "the servo process has ended"),
        (signal.SIGSTOP, "no frame for 1 s"),
    ],
)
def test_the_servo_process_is_lost(
    world: HdWorld, hands: Callable[..., Hands], blow: signal.Signals, words: str
) -> None:
    one = hands()
    one.until(lambda: one.gives() and one.gives("left"))
    process = world.devices[0].owner
    os.kill(process, blow)
    one.until(lambda: one.has_told(words) and one.has_told(words, "left"))
    one.forget()
    one.until(lambda: one.gives() and one.gives("left"))
    assert world.devices[0].owner not in (process, 0)


def test_the_host_is_killed_with_force_on_the_hands(library: Path, world: HdWorld) -> None:
    """The hub's end is silence of the contact models, in test_openhaptics_servo; this is the end of the
    process that passes them on.
    """
    with subprocess.Popen(
        [sys.executable, host.__file__, str(library), "1"],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    ) as process:
        try:
            while not all((_forces(world.rows(i))[-1:] > 1.2).any() for i in (0, 1)):
                _lift_and_press(world)
        finally:
            killed = monotonic()
            process.kill()
    _await(lambda: world.devices[0].owner == 0)
    for index in (0, 1):
        rows = world.rows(index)
        force = _forces(rows)
        assert force[-1] == 0.0
        # a tick may come late on a busy machine
        assert rows[force > 0.0, Row.TIME].max() - killed < 0.15 + rows[:, Row.GAP].max()
        assert np.diff(force).max() < 0.1 + 1e-9


@pytest.mark.parametrize("configured", [False, True])
def test_a_servo_process_whose_host_has_been_killed_while_it_starts(
    library: Path, world: HdWorld, configured: bool
) -> None:
    """No process is left that it could report to; it ends without a traceback."""
    memory, handle = create(memory_size(0))
    with (
        memory,
        subprocess.Popen(
            [sys.executable, "-P", "-m", "devices.haptics.servo.program"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=(handle,),
        ) as process,
    ):
        os.close(handle)
        process.stdout.close()
        if configured:
            orders = {
                "driver": Touch.driver,
                "options": {"library": str(library)},
                "memory": handle,
                "styluses": [],
            }
            process.stdin.write(json.dumps(orders).encode() + b"\n")
        process.stdin.close()
        assert (process.stderr.read(), process.wait(PATIENCE_S)) == (b"", 0)


def _lift_and_press(world: HdWorld) -> None:
    """Let both hands, with their dead-men held, go up and down; a busy host may be silent meanwhile, so this
    may need more than one try.
    """
    for height in (0.03, -0.005):
        for device in world.devices:
            device.buttons, device.target[1] = 1, height
        sleep(0.7)


def _forces(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(rows[:, Row.FORCE], axis=1)


def _await(fulfilled: Callable[[], bool]) -> None:
    end = monotonic() + PATIENCE_S
    while not fulfilled():
        assert monotonic() < end
        sleep(0.01)


def test_the_callback_does_not_wait_for_the_host(world: HdWorld, hands: Callable[..., Hands]) -> None:
    """In the host's process it would: Python hands over a busy interpreter after 5 ms."""
    one = hands(right={})
    one.until(one.gives)
    start = monotonic()
    one.until(lambda: monotonic() > start + 0.5)
    busy = monotonic()
    while monotonic() < busy + 0.5:
        sum(range(1000))
    rows = world.rows(0, start)
    idle, hard = rows[rows[:, Row.TIME] < busy], rows[rows[:, Row.TIME] >= busy]
    assert np.median(hard[:, Row.CALLBACK]) < 10.0 * np.median(idle[:, Row.CALLBACK])
    assert len(hard) > 0.5 * len(idle)


def test_a_stylus_that_is_not_there_is_told_of_and_comes(world: HdWorld, hands: Callable[..., Hands]) -> None:
    world.devices[1].plugged = 0
    one = hands()
    one.until(
        lambda: (
            one.gives()
            and one.has_told(
                "it cannot be opened (HD_COMM_ERROR (0x0302)): see that it is plugged in", "left"
            )
        )
    )
    assert "knows it as 'left'" in one.told("left")[0]
    world.devices[1].plugged = 1
    one.until(lambda: one.gives("left"))


def test_limits_above_those_of_the_device_are_refused(world: HdWorld, hands: Callable[..., Hands]) -> None:
    world.devices[0].max_force = 1.0
    one = hands(right={"safety": {"force": "1.5 N"}}, left={"device": "left"})
    one.until(
        lambda: one.has_told(
            "no force: safety.force is 1.5 N, but the device's limit is 0.6 N."
            " A scenario may only lower a limit."
        )
    )
    assert one.gives()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"force": "3 N"}, "less than or equal to 2"),
        ({"slew": "0.5 N"}, "less than or equal to 0.1"),
        ({"silence": "1 s"}, "styluses.right.safety.silence"),
        ({"strength": 1}, "Extra inputs"),
    ],
)
def test_no_scenario_raises_a_limit(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        TouchParams.model_validate({"styluses": {"right": {"safety": change}}})


def test_two_styluses_are_two_devices() -> None:
    with pytest.raises(
        ValidationError, match="'right' and 'left' are both the default device; give each a 'device'"
    ):
        TouchParams.model_validate({"styluses": {"right": {}, "left": {}}})


def test_a_wrong_library_is_an_error(tmp_path: Path) -> None:
    params = TouchParams.model_validate({"library": "libHD.so", "styluses": {"right": {}}})
    with pytest.raises(DeviceError, match="no library of OpenHaptics at"):
        Touch("touch", params).open(tmp_path)
    (tmp_path / "libHD.so").write_text("no library")
    with pytest.raises(DeviceError, match="cannot be loaded"):
        Touch("touch", params).open(tmp_path)


def test_only_contact_models_are_taken() -> None:
    touch = Touch("touch", TouchParams.model_validate({"styluses": {"right": {}}}))
    touch.write("right/contact", ContactModel(header=host.floor(0, 1).header))  # before `open`
    with pytest.raises(
        MessageError, match="takes a ContactModel on right/contact, not Sample on 'right/pose'"
    ):
        touch.write("right/pose", Sample("x", host.floor(0, 1)))  # pyright: ignore[reportArgumentType]
