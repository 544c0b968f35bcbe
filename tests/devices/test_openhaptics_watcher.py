"""The watcher of the servo process: what it finds in the frames, and what becomes of a force on a hand when
the servo process, a call of the driver, the watcher itself or the device's process stands still.

The bounds of the tests with processes grow with what the same run measures of the machine: how late a sleep
ends, and how long the system takes to clear a killed process away. bench/haptic_servo.py prints absolute
times.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest

from devices.haptics.safety import Condition
from devices.haptics.servo.exchange import RingWriter, beat, device_ends, memory_size, servo_ends
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.watcher import PERIOD, Watch
from tests.devices.standins import build, host
from tests.devices.standins.hd import VARIABLE, HdWorld, Row
from tests.waiting import LIMIT_S

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

STOP_S = 0.1
"""A stop from which the servo comes back."""
BOUND_S = 0.15
"""Within this the force is off, on an idle machine."""
PATIENCE_S = LIMIT_S
ON, OFF = (tuple(Condition).index(condition) for condition in (Condition.ON, Condition.OFF))


class Frames:
    """A watch of two styluses, with the writing ends of the servo."""

    def __init__(self) -> None:
        memory = memoryview(bytearray(memory_size(2)))
        self.states: list[RingWriter] = [servo_ends(memory, index)[1] for index in (0, 1)]
        self.watch = Watch([device_ends(memory, index)[1] for index in (0, 1)])
        self.beat = beat(memory)

    def tick(self, now: float, *causes: int) -> None:
        for states, cause in zip(self.states, causes, strict=True):
            states.write([now, ServoPhase.READY, 0, 0, 0, cause, *([0.0] * 21)])

    def killed_after(self, since: float, until: float = 1.0) -> float | None:
        """Look in the watcher's period; return how long after `since` the servo is to be killed."""
        for look in range(round(until / PERIOD)):
            if self.watch.look(since + look * PERIOD):
                return look * PERIOD
        return None


@pytest.mark.parametrize("causes", [(ON, OFF), (OFF, ON), (ON, ON)])
def test_a_servo_that_stands_still_under_force_is_killed_in_time(causes: tuple[int, int]) -> None:
    one = Frames()
    one.tick(7.0, *causes)
    after = one.killed_after(7.0)
    assert after is not None
    assert STOP_S + PERIOD < after < BOUND_S - 5 * PERIOD


def test_without_force_a_servo_may_stand_still() -> None:
    one = Frames()
    assert one.killed_after(0.0) is None  # no frame yet
    one.tick(7.0, ON, ON)
    one.tick(7.001, OFF, OFF)
    assert one.killed_after(7.001) is None


def test_after_a_pause_of_the_whole_machine_the_servo_has_time_for_a_tick() -> None:
    one = Frames()
    one.tick(7.0, ON, OFF)
    assert not one.watch.look(9.0)
    one.tick(9.001, ON, OFF)
    assert not one.watch.look(9.0 + PERIOD)
    after = one.killed_after(9.001)
    assert after is not None
    assert after > STOP_S


def test_the_counter_lies_behind_the_rings() -> None:
    one = Frames()
    one.beat[0] = 2**64 - 1
    one.tick(7.0, ON, ON)
    assert one.beat[0] == 2**64 - 1
    assert one.killed_after(7.0) is not None


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build.compile_library("hd.c", tmp_path_factory.mktemp("hd") / "libHD.so")


class Held:
    """A device host, a process of its own, with force on both hands."""

    def __init__(self, library: Path, file: Path) -> None:
        self.world = HdWorld(library, file)
        root = str(Path(__file__).parents[2])
        environment = {**os.environ, "PYTHONPATH": root, VARIABLE: str(file)}
        self.process = subprocess.Popen([sys.executable, host.__file__, str(library), "1"], env=environment)

    @property
    def servo(self) -> int:
        return self.world.devices[0].owner

    @property
    def watcher(self) -> int:
        """The newest process of the host that runs the watcher."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return max(int(c) for c in children if b"watcher" in Path(f"/proc/{c}/cmdline").read_bytes())

    def force(self, device: int = 0) -> float:
        return float(np.linalg.norm(self.world.motors(device)))

    def press(self) -> None:
        """Lift and press both hands until they feel the floor; a busy machine may need more than one try."""
        end = monotonic() + PATIENCE_S
        while not (self.servo and _is_running(self.servo) and min(self.force(0), self.force(1)) > 1.2):
            assert monotonic() < end
            for height in (0.03, -0.005):
                for device in self.world.devices:
                    device.buttons, device.target[1] = 1, height
                sleep(0.7)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()


def _is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _await(fulfilled: Callable[[], bool]) -> None:
    end = monotonic() + PATIENCE_S
    while not fulfilled():
        assert monotonic() < end
        sleep(0.002)


@pytest.fixture
def held(library: Path, tmp_path: Path) -> Iterator[Held]:
    made = Held(library, tmp_path / "world")
    try:
        made.press()
        yield made
    finally:
        made.close()


class Machine:
    """How late the machine is, s."""

    lateness = 0.0
    """Largest delay of a sleep as long as the watcher's."""
    clearing = 0.0
    """From SIGKILL of the servo process to the end of the process, which closes the device."""

    @property
    def allowance(self) -> float:
        """What a watcher that sleeps a few times, and then kills, may take longer than on an idle machine."""
        return 10 * self.lateness + 3 * self.clearing


@contextmanager
def _measured() -> Generator[Machine]:
    machine, over = Machine(), threading.Event()

    def sleeper() -> None:
        while not over.is_set():
            begun = monotonic()
            sleep(PERIOD)
            machine.lateness = max(machine.lateness, monotonic() - begun - PERIOD)

    thread = threading.Thread(target=sleeper)
    thread.start()
    try:
        yield machine
    finally:
        over.set()
        thread.join()


def _recovers(held: Held, lost: int) -> None:
    """The device comes back by a new servo process, without force before the hand has left the contact."""
    _await(lambda: held.servo not in (lost, 0) and _is_running(held.servo))
    held.press()


@pytest.mark.long
@pytest.mark.parametrize("how", ["stopped", "blocked before the force", "blocked after the force"])
def test_a_servo_that_stands_still_loses_its_device_in_time(held: Held, how: str) -> None:
    """And as in all of this module, without any help of the device's process, which is stopped."""
    with _measured() as machine:
        servo = held.servo
        held.process.send_signal(signal.SIGSTOP)
        os.kill(held.watcher, 0)
        still = monotonic()
        if how == "stopped":
            os.kill(servo, signal.SIGSTOP)
        else:
            held.world.devices[1].blocked = 1 if "before" in how else 2
        # the hand is under force until then, so silence of the simulation has not taken it
        freed = held.world.release(0, servo)
        assert held.force() > 1.0
        held.world.devices[1].blocked = 0
        held.process.send_signal(signal.SIGCONT)
        _recovers(held, servo)
        killed, servo = monotonic(), held.servo
        os.kill(servo, signal.SIGKILL)
        machine.clearing = held.world.release(0, servo) - killed
    assert STOP_S < freed - still < BOUND_S + machine.allowance


def test_a_short_stop_comes_back_without_a_step(held: Held) -> None:
    servo, longest, force = held.servo, 0.0, np.zeros(1)
    for _ in range(10):
        begun = monotonic()
        os.kill(servo, signal.SIGSTOP)
        sleep(STOP_S - 0.002)
        os.kill(servo, signal.SIGCONT)
        _await(lambda begun=begun: bool((held.world.rows(0, begun)[-20:, Row.GAP] < 0.01).sum() > 10))
        longest = held.world.rows(0, begun)[:, Row.GAP].max()
        force = np.linalg.norm(held.world.rows(0, begun - 0.1)[:, Row.FORCE], axis=1)
        if longest < STOP_S + 0.005 and force.min() > 1.0:
            break
        held.press()  # the machine was late: more than a short stop, or silence of the simulation
        servo = held.servo
    assert STOP_S - 0.02 < longest < STOP_S + 0.005
    assert held.servo == servo
    assert np.abs(np.diff(force)).max() < 0.1 + 1e-9
    assert force.min() > 1.0


@pytest.mark.long
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])
def test_a_watcher_that_is_lost_takes_the_force_with_it(held: Held, blow: signal.Signals) -> None:
    servo, watcher = held.servo, held.watcher
    begun = monotonic()
    os.kill(watcher, blow)
    freed = held.world.release(0, servo)
    rows = held.world.rows(0)
    rows = rows[(rows[:, Row.TIME] > begun) & (rows[:, Row.TIME] < freed)]
    assert (
        np.count_nonzero(np.linalg.norm(rows[:, Row.FORCE], axis=1)) <= 100 + 20
    )  # ticks, and its last beats
    _recovers(held, servo)
    assert held.watcher != watcher
    _await(lambda: not _is_running(watcher))


def test_the_host_is_killed_while_the_servo_stands_still(held: Held) -> None:
    servo, watcher = held.servo, held.watcher
    with _measured() as machine:
        os.kill(servo, signal.SIGSTOP)
        still = monotonic()
        held.process.kill()
        freed = held.world.release(0, servo)
        machine.clearing = 0.02
    assert freed - still < BOUND_S + machine.allowance
    _await(lambda: not _is_running(watcher))


def test_a_host_that_ends_leaves_nothing_behind(held: Held) -> None:
    servo, watcher = held.servo, held.watcher
    held.process.kill()
    _await(lambda: not _is_running(servo) and not _is_running(watcher))
    forces = [np.linalg.norm(held.world.rows(i)[:, Row.FORCE], axis=1) for i in (0, 1)]
    assert [force[-1] for force in forces] == [0.0, 0.0]
    assert all(late - early < 0.1 + 1e-9 for force in forces for early, late in pairwise(force))
