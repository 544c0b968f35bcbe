"""The servo callback against the stand-in of HDAPI, tick by tick: the test is the scheduler, so nothing here
depends on how long it takes.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase as HypothesisPhase
from hypothesis import given, settings
from hypothesis import strategies as st

from devices.diagnosis import Level
from devices.haptics.contact import Plane
from devices.haptics.limits import Limits
from devices.haptics.safety import Condition
from devices.haptics.servo import diagnoses
from devices.haptics.servo.driver import Opened, StylusSpec
from devices.haptics.servo.exchange import (
    RingReader,
    RingWriter,
    State,
    beat,
    device_ends,
    memory_size,
    model_doubles,
    servo_ends,
)
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.servo import Servo
from devices.haptics.servo.stylus import Stylus
from devices.openhaptics import hdapi
from devices.openhaptics.device import Touch
from devices.openhaptics.driver import HdapiDriver
from devices.openhaptics.hdapi import CALLBACK_CONTINUE, CALLBACK_DONE, Code
from schemas.errors import DeviceError
from tests.devices.standins import build
from tests.devices.standins.hd import (
    AUTO,
    ENCODER_RESET,
    INKWELL,
    NEEDS_MANUAL_INPUT,
    NEEDS_UPDATE,
    OK,
    HdWorld,
)

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

DT = 0.001
FLOOR = Plane(0.0, 0.0, 1.0, 0.01, 0.0, 200.0, 1.0, 0.3)
"""10 mm above the origin: a hand at rest there is pushed with about 1 N."""


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build.compile_library("hd.c", tmp_path_factory.mktemp("hd") / "libHD.so")


class Rig:
    """Both styluses of a world behind a Servo, with the ends that a device has."""

    def __init__(self, library: Path, file: Path, **spec: Any) -> None:
        self.driver = HdapiDriver(str(library))
        self.hd = self.driver.hd
        self.world = HdWorld(library, file)
        self.hd.standin_use.argtypes = [ctypes.c_void_p]
        self.hd.standin_tick.argtypes = [ctypes.c_double]
        self.hd.standin_use(self.world.address)
        memory = memoryview(bytearray(memory_size(2)))
        self.beat, self.watched = beat(memory), True
        self.styluses: list[Stylus] = []
        self.models: list[RingWriter] = []
        self._states: list[RingReader] = []
        for index, device in enumerate((None, "left")):
            stated = StylusSpec("right", device, **{"dead_man": 0, "tip_offset": 0.0, **spec})
            opened = self.driver.open(stated)
            assert isinstance(opened, Opened)
            ends = servo_ends(memory, index)
            self.styluses.append(Stylus(self.driver, opened.handle, stated, *ends))
            models, states = device_ends(memory, index)
            self.models.append(models)
            self._states.append(states)
        self.servo = Servo(self.driver, self.styluses, self.beat)
        self._last: list[State] = [
            None,
            None,
        ]  # pyright: ignore[reportAttributeAccessIssue]  # there is one after the first tick
        self.now = 100.0
        self.answer = CALLBACK_CONTINUE
        self.sent: list[float] = []
        """Norm of the force on the first hand, tick by tick."""

    def allow(self) -> None:
        for stylus in self.styluses:
            stylus.allow(Limits(), passivity=False)

    def run(self, ticks: int = 5, *, planes: list[Plane] | None = None, touching: bool = False) -> State:
        """Go on; return the last state of the first stylus.

        `planes`: contact models of these arrive; `touching`: of the floor.
        """
        planes = [FLOOR] if touching else planes
        for _ in range(ticks):
            self.now += DT
            self.beat[0] += self.watched
            self.hd.standin_tick(DT)
            if planes is not None:
                for models in self.models:
                    models.write(model_doubles(planes, round(self.now * 1e9), self.now))
            if self.answer == CALLBACK_CONTINUE:
                self.answer = CALLBACK_CONTINUE if self.servo.tick(self.now) else CALLBACK_DONE
            self.sent.append(math.hypot(*self.world.motors(0)))
        return self.state(0)

    def state(self, stylus: int) -> State:
        self._last[stylus] = next(
            (State.of(record) for record in reversed(self._states[stylus].read())), self._last[stylus]
        )
        return self._last[stylus]

    def press(self, ticks: int = 2000) -> State:
        """Bring both hands into the contact from above, with the dead-man held, until there is force."""
        self.allow()
        for device in self.world.devices:
            device.buttons, device.target[1] = 1, 0.03
        self.run(ticks // 4, touching=True)
        for device in self.world.devices:
            device.target[1] = -0.005
        return self.run(ticks, touching=True)


@pytest.fixture
def rig(library: Path, tmp_path: Path) -> Callable[..., Rig]:
    return lambda **spec: Rig(library, tmp_path / "world", **spec)


def test_a_stylus_is_ready_after_three_clean_frames_and_gives_no_force_before_it_is_allowed(
    rig: Callable[..., Rig],
) -> None:
    one = rig()
    assert ServoPhase(one.run(2).phase) is ServoPhase.SETTLING
    state = one.run(1)
    assert (ServoPhase(state.phase), state.code) == (ServoPhase.READY, 0)
    one.world.devices[0].buttons = 1
    assert one.run(1500, touching=True).force == (0.0, 0.0, 0.0)
    assert not any(one.sent)


def test_force_comes_in_slowly_holds_the_hand_and_is_what_was_told(rig: Callable[..., Rig]) -> None:
    one = rig()
    state = one.press()
    assert Condition.ON is tuple(Condition)[state.cause]
    # hand and floor, both 200 N/m, 15 mm apart
    assert state.force == pytest.approx((0.0, 0.0, 1.5), abs=0.05)
    assert np.array(one.world.motors(0)) == pytest.approx((0.0, 1.5, 0.0), abs=0.05)  # HDAPI's y is up
    assert max(np.diff(one.sent)) < 0.1 + 1e-9


def test_the_servo_stops_with_a_frame_without_force(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    assert one.sent[-1] > 1.0
    one.servo.stop()  # not started: nothing to wait for
    one.run(1)
    assert one.answer == CALLBACK_DONE
    assert one.sent[-1] == 0.0


@pytest.mark.parametrize(
    "code",
    [
        Code.WARM_MOTORS,
        Code.EXCEEDED_MAX_FORCE,
        Code.EXCEEDED_MAX_FORCE_IMPULSE,
        Code.EXCEEDED_MAX_VELOCITY,
        Code.INVALID_VALUE,
    ],
)
def test_a_warning_takes_the_force_and_lets_it_come_back(rig: Callable[..., Rig], code: Code) -> None:
    one = rig()
    one.press()
    device = one.world.devices[0]
    device.error, device.error_frames = code, 1
    state = one.run(2, touching=True)
    assert (ServoPhase(state.phase), state.code, state.force) == (ServoPhase.WARNED, code, (0.0, 0.0, 0.0))
    assert ServoPhase(one.state(1).phase) is ServoPhase.READY  # the other hand keeps its force
    assert math.hypot(*one.world.motors(1)) > 1.0
    device.target[1] = 0.03
    assert ServoPhase(one.run(1100, touching=True).phase) is ServoPhase.READY
    device.target[1] = -0.005
    assert one.run(2000, touching=True).force[2] > 1.0
    assert max(np.diff(one.sent)) < 0.1 + 1e-9


def test_a_storm_of_warnings_keeps_the_force_away(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    one.world.devices[0].error, one.world.devices[0].error_frames = Code.EXCEEDED_MAX_FORCE, 10_000
    one.run(2, touching=True)
    calm = len(one.sent)
    assert ServoPhase(one.run(3000, touching=True).phase) is ServoPhase.WARNED
    assert not any(one.sent[calm:])


@pytest.mark.parametrize(
    ("code", "phase"),
    [
        (Code.COMM_ERROR, ServoPhase.FAULT),
        (Code.DEVICE_FAULT, ServoPhase.FAULT),
        (Code.TIMER_ERROR, ServoPhase.BUSY),
    ],
)
def test_a_fault_ends_the_schedule_with_a_frame_without_force(
    rig: Callable[..., Rig], code: Code, phase: ServoPhase
) -> None:
    one = rig()
    one.press()
    one.world.devices[0].error, one.world.devices[0].error_frames = code, 1
    state = one.run(2, touching=True)
    assert one.answer == CALLBACK_DONE
    assert (ServoPhase(state.phase), state.code) == (phase, code)
    assert [math.hypot(*one.world.motors(i)) for i in (0, 1)] == [0.0, 0.0]


def test_the_placeholder_pose_means_that_another_program_has_the_device(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.run()
    one.world.devices[0].placeholder = 1
    assert (
        ServoPhase(one.run(1).phase) is ServoPhase.SETTLING
    )  # from the first such frame on there is no pose
    assert ServoPhase(one.run(2).phase) is ServoPhase.BUSY
    one.run(1)
    assert one.answer == CALLBACK_DONE


def test_inkwell(rig: Callable[..., Rig]) -> None:
    one = rig()
    device = one.world.devices[0]
    device.calibration, device.buttons = NEEDS_MANUAL_INPUT, 1
    one.allow()
    state = one.run(200, touching=True)
    assert (ServoPhase(state.phase), state.code, state.force, device.force_output) == (
        ServoPhase.UNCALIBRATED,
        INKWELL,
        (0.0, 0.0, 0.0),
        0,
    )
    device.inkwell = 1
    assert ServoPhase(one.run(5).phase) is ServoPhase.READY
    assert (device.updates, device.force_output) == (1, 1)


@pytest.mark.parametrize(
    ("offered", "used"),
    [(AUTO | INKWELL | ENCODER_RESET, AUTO), (INKWELL | ENCODER_RESET, INKWELL), (INKWELL, INKWELL)],
)
def test_the_best_calibration_style_is_used(rig: Callable[..., Rig], offered: int, used: int) -> None:
    one = rig()
    one.world.devices[0].styles = offered
    one.run()
    assert (one.world.devices[0].updates, one.world.devices[0].last_style) == (1, used)


def test_an_encoder_reset_waits_for_the_person_who_holds_the_stylus_in_its_place(
    rig: Callable[..., Rig],
) -> None:
    one = rig()
    device = one.world.devices[0]
    device.styles = ENCODER_RESET
    state = one.run(200)
    assert (ServoPhase(state.phase), state.code, device.updates) == (
        ServoPhase.UNCALIBRATED,
        ENCODER_RESET,
        0,
    )
    device.buttons = 1
    assert ServoPhase(one.run(5).phase) is ServoPhase.READY
    assert device.updates == 1


def test_a_stylus_that_loses_its_calibration_gives_neither_pose_nor_force(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    one.world.devices[0].calibration = NEEDS_MANUAL_INPUT
    state = one.run(200, touching=True)
    assert not ServoPhase(state.phase).has_pose
    assert (state.force, one.world.devices[0].force_output) == ((0.0, 0.0, 0.0), 0)


@pytest.mark.parametrize("code", [Code.EXCEEDED_MAX_FORCE, Code.COMM_ERROR])
def test_a_stylus_that_waits_for_its_calibration_does_not_hide_what_another_complains_of(
    rig: Callable[..., Rig], code: Code
) -> None:
    one = rig()
    one.press()
    # asks, tick by tick, and is refused
    one.world.devices[1].calibration, one.world.devices[1].styles = NEEDS_UPDATE, 0
    assert one.run(200, touching=True).force[2] > 1.0
    assert ServoPhase(one.state(1).phase) is ServoPhase.UNCALIBRATED
    one.world.devices[0].error, one.world.devices[0].error_frames = code, 1
    state = one.run(2, touching=True)
    assert (state.code, state.force) == (code, (0.0, 0.0, 0.0))


def test_a_stylus_that_is_unplugged_while_it_is_not_calibrated_is_lost(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.world.devices[0].calibration, one.world.devices[0].styles = NEEDS_UPDATE, 0
    one.run()
    one.world.devices[0].error, one.world.devices[0].error_frames = Code.COMM_ERROR, 1
    assert ServoPhase(one.run(2).phase) is ServoPhase.FAULT


def test_a_complaint_of_a_stylus_that_is_not_calibrated_leaves_what_to_do_about_that(
    rig: Callable[..., Rig],
) -> None:
    one = rig()
    device = one.world.devices[0]
    device.calibration, device.error, device.error_frames = NEEDS_MANUAL_INPUT, Code.WARM_MOTORS, 100
    assert diagnoses.present(one.run(50), Touch.words, "") == (
        Level.WARN,
        "it is not calibrated: put the stylus into the inkwell",
    )


def test_a_warning_is_no_letting_go_for_a_hand_that_was_too_fast(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    device = one.world.devices[0]
    device.velocity[1] = -5.0
    one.run(2, touching=True)
    device.error, device.error_frames, device.target[1] = Code.EXCEEDED_MAX_VELOCITY, 1, 0.03
    one.run(1200, touching=True)
    device.target[1] = -0.005
    state = one.run(1500, touching=True)
    assert (ServoPhase(state.phase), tuple(Condition)[state.cause], state.force) == (
        ServoPhase.READY,
        Condition.TOO_FAST,
        (0.0, 0.0, 0.0),
    )


@pytest.mark.parametrize(
    ("dead_man", "field", "held"),
    [(0, "buttons", 1), (1, "buttons", 2), ("safety-switch", "safety_switch", 1)],
)
def test_what_is_held_permits_force(
    rig: Callable[..., Rig], dead_man: int | str, field: str, held: int
) -> None:
    one = rig(dead_man=dead_man)
    setattr(one.world.devices[0], field, held)
    assert one.run().permitted == 1
    setattr(one.world.devices[0], field, held ^ 1 if isinstance(dead_man, str) else 0)
    assert one.run().permitted == 0


def test_the_dead_man_takes_the_force_at_once(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    one.world.devices[0].buttons = 0
    assert one.run(1, touching=True).force == (0.0, 0.0, 0.0)


def test_silence_of_the_simulation_takes_the_force_within_150_ms(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    before = len(one.sent)
    one.run(200)
    quiet = np.array(one.sent[before:])
    assert quiet[90] > 1.0
    assert not quiet[150:].any()
    assert np.diff(quiet).max() < 0.1


def test_a_watcher_without_a_sign_of_life_takes_the_force_and_returns_it_slowly(
    rig: Callable[..., Rig],
) -> None:
    one = rig()
    one.press()
    one.watched = False
    assert one.run(99, touching=True).force[2] > 1.0
    state = one.run(1, touching=True)
    assert (ServoPhase(state.phase), state.force) == (ServoPhase.UNWATCHED, (0.0, 0.0, 0.0))
    assert ServoPhase(state.phase).has_pose
    assert diagnoses.present(state, Touch.words, "") == (
        Level.WARN,
        "no force: the process that watches the servo process is late; is the machine busy?",
    )
    one.watched = True
    calm = len(one.sent)
    assert ServoPhase(one.run(200, touching=True).phase) is ServoPhase.READY
    assert not any(one.sent[calm:])  # the hand has not left the contact
    one.world.devices[0].target[1] = 0.03
    one.run(500, touching=True)
    one.world.devices[0].target[1] = -0.005
    assert one.run(2000, touching=True).force[2] > 1.0
    assert max(np.diff(one.sent)) < 0.1 + 1e-9


def test_a_watcher_that_does_not_return_ends_the_schedule(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.press()
    one.watched = False
    state = one.run(1001, touching=True)
    assert (one.answer, ServoPhase(state.phase)) == (CALLBACK_DONE, ServoPhase.FAULT)
    assert one.servo.failure == "the process that watches the servo process has ended or stands still"
    assert [math.hypot(*one.world.motors(i)) for i in (0, 1)] == [0.0, 0.0]


def test_an_exception_in_the_callback_ends_in_a_frame_without_force_on_every_hand(
    rig: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = rig()
    one.press()

    def fails(now: float, *, watched: bool) -> None:
        raise ValueError("a bug")

    monkeypatch.setattr(one.styluses[1], "frame", fails)
    state = one.run(2, touching=True)
    assert (one.answer, one.servo.failure) == (CALLBACK_DONE, "ValueError: a bug")
    assert ServoPhase(state.phase) is ServoPhase.FAULT
    assert [math.hypot(*one.world.motors(i)) for i in (0, 1)] == [0.0, 0.0]


numbers = st.floats(-1e3, 1e3) | st.sampled_from([math.nan, math.inf, -math.inf])
events = st.one_of(
    st.tuples(st.just("buttons"), st.integers(0, 3)),
    st.tuples(st.just("placeholder"), st.integers(0, 1)),
    st.tuples(st.just("calibration"), st.sampled_from([NEEDS_UPDATE, NEEDS_MANUAL_INPUT])),
    st.tuples(st.just("inkwell"), st.integers(0, 1)),
    st.tuples(st.just("error"), st.sampled_from([code for code in Code if code])),
    st.tuples(st.just("planes"), st.lists(st.builds(Plane, *[numbers] * 8), max_size=4)),
    st.tuples(st.just("height"), st.floats(-0.05, 0.05)),
    st.tuples(st.just("silence"), st.booleans()),
)


@pytest.mark.long
@settings(max_examples=10, phases=[HypothesisPhase.generate])
@given(days=st.lists(st.tuples(events, st.integers(1, 60)), max_size=12))
def test_whatever_happens_the_force_keeps_its_limits(
    library: Path, tmp_path_factory: pytest.TempPathFactory, days: list[tuple[tuple[str, Any], int]]
) -> None:
    """From a hand with force in it, through random bad days: never above the limit, never up by more than the
    slew, zero where nothing permits it.
    """
    one = Rig(library, tmp_path_factory.mktemp("world") / "world")
    one.press(ticks=1000)
    assert one.sent[-1] > 0.5
    device, planes, silent = one.world.devices[0], [FLOOR], False
    for (what, value), ticks in days:
        if what == "error":
            device.error, device.error_frames = value, 1
        elif what == "planes":
            planes = value
        elif what == "silence":
            silent = value
        elif what == "height":
            device.target[1] = value
        else:
            setattr(device, what, value)
        for _ in range(ticks):
            complained = device.error_frames and what == "error"
            one.run(1, planes=None if silent else planes)
            if complained or not device.buttons & 1 or device.calibration != OK or device.placeholder:
                assert one.run(1, planes=None if silent else planes).force == (0.0, 0.0, 0.0)
    assert max(one.sent) <= Limits().force + 1e-9
    assert max(np.diff(one.sent)) <= 0.1 + 1e-9


def test_a_clean_run_leaves_no_error_in_the_library(rig: Callable[..., Rig]) -> None:
    one = rig(dead_man="safety-switch")
    assert ServoPhase(one.run(300).phase) is ServoPhase.READY
    assert ServoPhase(one.state(1).phase) is ServoPhase.READY
    assert hdapi.errors(one.hd) == []


def test_errors_come_with_their_handle_the_newest_first(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.hd.hdMakeCurrentDevice(1)
    one.hd.hdUpdateCalibration(AUTO)
    one.hd.hdSetSchedulerRate(3)
    assert hdapi.errors(one.hd) == [(Code.INVALID_VALUE, 1), (Code.INVALID_OPERATION, 1)]


def test_the_servo_process_holds_nothing_that_could_delay_a_callback() -> None:
    code = (
        "import sys, devices.haptics.servo.program, devices.openhaptics.driver; print(*{m.split('.')[0] for m"
        " in sys.modules} & {'numpy', 'pydantic', 'zenoh', 'hub', 'logging'})"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == ""
    )


def test_names_of_errors() -> None:
    assert Code.text(0x0102) == "HD_INVALID_OPERATION (0x0102)"
    assert Code.text(0x0999) == "HDAPI error 0x0999"


def test_the_library_is_found_where_the_loader_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "libHD.so").touch()
    monkeypatch.setenv("LD_LIBRARY_PATH", f"/nowhere:{tmp_path}")
    assert hdapi.find(None) == tmp_path / "libHD.so"


def test_a_library_that_is_not_there_or_is_another(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"no library of OpenHaptics at '.*hd\.dll'.*'library: PATH'"):
        hdapi.find(tmp_path / "hd.dll")
    text = tmp_path / "libHD.so"
    text.write_text("no library")
    with pytest.raises(DeviceError, match="cannot be loaded"):
        hdapi.load(hdapi.find(text))
    with pytest.raises(DeviceError, match="hdInitDevice"):
        hdapi.load(Path(ctypes.util.find_library("m") or ""))


def test_needs_update_is_what_a_device_has_after_power_on(rig: Callable[..., Rig]) -> None:
    one = rig()
    one.run()
    assert one.world.devices[0].updates == 1
    one.world.devices[0].calibration = NEEDS_UPDATE
    one.run(200)
    assert one.world.devices[0].updates == 2
