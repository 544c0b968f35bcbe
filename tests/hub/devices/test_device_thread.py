import threading
from pathlib import Path
from time import sleep

import numpy as np
import pytest

from hub.devices.device_thread import DeviceThread
from hub.participant import Sample
from schemas.errors import MessageError, ParticipantError
from schemas.ros import Float64Message, Joy
from tests.hub.parts import Stylus, out

MS = 1_000_000


class Pen(Stylus):
    """Says how often it was read, and button 1 at the third read; what it is told to raise, it raises."""

    def __init__(self, fails_at=10**9, refuses=None):
        super().__init__("pen", out("count"), out("button", variability="event"))
        self.reads, self.fails_at, self.refuses = 0, fails_at, refuses
        self.closed = False

    def read(self, t):
        self.reads += 1
        if self.reads == self.fails_at:
            raise OSError("the cable is out")
        yield Sample("count", Float64Message(data=float(self.reads)))
        if self.reads == 3:
            yield Sample("button", Joy(buttons=np.array([1], np.int32)))

    def write(self, port, value):
        if self.refuses is not None:
            raise self.refuses

    def close(self):
        self.closed = True


class Uplink:
    def __init__(self):
        self.got = []
        self.enough = threading.Event()

    def exchange(self, t, samples):
        self.got.extend((t, sample.port) for sample in samples)
        if len(self.got) > 20:
            self.enough.set()


@pytest.fixture
def start():
    loops = []

    def start(pen, period_ns=MS):
        failures = []
        loop = DeviceThread("pen", pen, period_ns, failed=lambda *failure: failures.append(failure))
        loops.append(loop)
        loop.start(Path.cwd())
        return loop, failures

    yield start
    for loop in loops:
        loop.close()


def test_an_uplink_gets_what_is_read_while_it_is_attached_and_the_buttons_as_they_are(start):
    pen, uplink, later = Pen(), Uplink(), Uplink()
    loop, failures = start(pen)
    while pen.reads < 10:
        sleep(0.001)
    loop.attach(uplink)
    assert uplink.enough.wait(5)
    loop.attach(later)
    told = len(uplink.got)
    assert later.enough.wait(5)
    assert len(uplink.got) == told
    for got in (uplink.got, later.got):
        assert [port for _, port in got][:2] == ["button", "count"]
        times = [t for t, _ in got]
        assert times == sorted(times)
        assert [port for _, port in got].count("button") == 1
    loop.close()
    assert pen.closed
    assert failures == []


def test_what_a_device_raises_is_told_once_and_ends_its_loop(start):
    pen = Pen(fails_at=5)
    _, failures = start(pen)
    while not failures:
        sleep(0.001)
    sleep(0.02)
    assert failures == [("pen", "OSError: the cable is out")]
    assert pen.reads == 5


def test_a_value_that_is_refused_is_the_writers_affair_and_any_other_error_the_devices(start):
    loop, failures = start(Pen(refuses=MessageError("no such port")))
    with pytest.raises(MessageError, match="no such port"):
        loop.write("force", 1.0)
    assert failures == []
    loop, failures = start(Pen(refuses=OSError("burnt out")))
    loop.write("force", 1.0)
    loop.write("force", 1.0)
    assert failures == [("pen", "OSError: burnt out")]


def test_a_device_that_cannot_be_opened_says_so():
    class Unplugged(Pen):
        def open(self, directory):
            raise OSError("no such device")

    with pytest.raises(ParticipantError, match=r"participant 'pen' failed.*cannot be opened: no such device"):
        DeviceThread("pen", Unplugged(), MS, failed=lambda *_: None).start(Path.cwd())


class Doorbell(Pen):
    """Says at once when there is something new."""

    def __init__(self):
        super().__init__()
        self.rung = threading.Event()

    def wait(self, seconds):
        return self.rung.wait(seconds)

    def read(self, t):
        self.rung.clear()
        yield from super().read(t)


def test_what_is_new_is_read_before_the_period_is_over(start):
    bell, uplink = Doorbell(), Uplink()
    loop, failures = start(bell, 3600 * 1000 * MS)
    loop.attach(uplink)
    for _ in range(25):
        bell.rung.set()
        while bell.rung.is_set():
            sleep(1e-4)
    assert uplink.enough.wait(5.0)
    assert not failures
