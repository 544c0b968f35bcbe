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
    """Returns how often it was read, and button 1 at the third read; raises the errors it is given."""

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
    threads = []

    def start(pen, period_ns=MS):
        failures = []
        thread = DeviceThread("pen", pen, period_ns, failed=lambda *failure: failures.append(failure))
        threads.append(thread)
        thread.start(Path.cwd())
        return thread, failures

    yield start
    for thread in threads:
        thread.close()


def test_an_attached_uplink_gets_all_samples_and_first_the_present_buttons(start):
    pen, uplink, later = Pen(), Uplink(), Uplink()
    thread, failures = start(pen)
    while pen.reads < 10:
        sleep(0.001)
    thread.attach(uplink)
    assert uplink.enough.wait(60.0)
    thread.attach(later)
    count = len(uplink.got)
    assert later.enough.wait(60.0)
    assert len(uplink.got) == count
    for got in (uplink.got, later.got):
        assert [port for _, port in got][:2] == ["button", "count"]
        times = [t for t, _ in got]
        assert times == sorted(times)
        assert [port for _, port in got].count("button") == 1
    thread.close()
    assert pen.closed
    assert failures == []


def test_an_error_of_a_device_is_reported_once_and_ends_its_thread(start):
    pen = Pen(fails_at=5)
    _, failures = start(pen)
    while not failures:
        sleep(0.001)
    sleep(0.02)
    assert failures == [("pen", "OSError: the cable is out")]
    assert pen.reads == 5


def test_a_refused_value_is_raised_to_the_writer_and_any_other_error_ends_the_device(start):
    thread, failures = start(Pen(refuses=MessageError("no such port")))
    with pytest.raises(MessageError, match="no such port"):
        thread.write("force", 1.0)
    assert failures == []
    thread, failures = start(Pen(refuses=OSError("burnt out")))
    thread.write("force", 1.0)
    thread.write("force", 1.0)
    assert failures == [("pen", "OSError: burnt out")]


def test_a_device_that_cannot_be_opened_is_named():
    class Unplugged(Pen):
        def open(self, directory):
            raise OSError("no such device")

    with pytest.raises(ParticipantError, match=r"participant 'pen' failed.*cannot be opened: no such device"):
        DeviceThread("pen", Unplugged(), MS, failed=lambda *_: None).start(Path.cwd())


def test_a_device_that_raises_while_it_is_closed_keeps_nothing_open(start, caplog):
    class Stuck(Pen):
        def close(self):
            raise OSError("the driver does not answer")

    thread, failures = start(Stuck())
    thread.close()
    assert failures == []
    (record,) = caplog.records
    assert record.message == "device 'pen' raised while it was closed"
    caplog.clear()


class Doorbell(Pen):
    """Returns from `wait` at once when there is something new."""

    def __init__(self):
        super().__init__()
        self.rung = threading.Event()

    def wait(self, seconds):
        return self.rung.wait(seconds)

    def read(self, t):
        self.rung.clear()
        yield from super().read(t)


def test_a_device_with_news_is_read_before_its_period_is_over(start):
    bell, uplink = Doorbell(), Uplink()
    thread, failures = start(bell, 3600 * 1000 * MS)
    thread.attach(uplink)
    for _ in range(25):
        bell.rung.set()
        while bell.rung.is_set():
            sleep(1e-4)
    assert uplink.enough.wait(60.0)
    assert not failures
