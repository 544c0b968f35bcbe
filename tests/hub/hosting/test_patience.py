import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from time import sleep

import pytest

from hub.hosting import patience as patience_module
from hub.hosting.patience import Patience

ENDLESS = "import os; parent = os.getppid()\nwhile os.getppid() == parent: pass"  # not longer than the tests
BUSY = [sys.executable, "-P", "-c", ENDLESS]


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test moves, and the run delay of one thread."""

    class Clock:
        now_ns = 0
        delay_ns = 0

        def advance(self, seconds, *, delayed=0.0):
            self.now_ns += round(seconds * 1e9)
            self.delay_ns += round(delayed * 1e9)

    clock = Clock()
    monkeypatch.setattr(patience_module, "monotonic_ns", lambda: clock.now_ns)
    monkeypatch.setattr(patience_module, "_run_delays", lambda _: {"thread": clock.delay_ns})
    return clock


def test_a_process_that_sleeps_or_computes_uses_its_time_up(clock):
    patience = Patience(3 * 10**9)
    for _ in range(3):
        clock.advance(1.0)
        assert not patience.is_over([1])
    clock.advance(0.1)
    assert patience.is_over([1])


def test_time_spent_waiting_for_a_processor_does_not_count(clock):
    patience = Patience(3 * 10**9)
    for _ in range(40):
        clock.advance(1.0, delayed=0.95)
        assert not patience.is_over([1])
    clock.advance(1.0)
    assert patience.is_over([1])


def test_the_next_wait_has_the_whole_limit_and_no_delay_from_before(clock):
    patience = Patience(3 * 10**9)
    for _ in range(5):
        clock.advance(1.0, delayed=0.9)
        assert not patience.is_over([1])
    clock.advance(50.0, delayed=40.0)
    patience.begin()
    clock.advance(2.9)
    assert not patience.is_over([1])
    clock.advance(0.2)
    assert patience.is_over([1])


@contextmanager
def busy_processes(count):
    with ExitStack() as stack:
        started = list[subprocess.Popen[bytes]]()
        for _ in range(count):
            started.append(stack.enter_context(subprocess.Popen(BUSY)))
            stack.callback(started[-1].kill)  # also if the next one does not start: the loops are endless
        yield started


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells the run delay")
def test_linux_tells_the_run_delay_of_processes_that_share_a_processor():
    core = min(os.sched_getaffinity(0))
    with busy_processes(2) as both:
        for process in both:
            os.sched_setaffinity(process.pid, {core})
        numbers = [process.pid for process in both]
        while min(patience_module._run_delays([number])[_main_thread(number)] for number in numbers) < 10**7:
            sleep(0.01)
    assert patience_module._run_delays(numbers) == {}


def _main_thread(number):
    return patience_module.Path(f"/proc/{number}/task/{number}/schedstat")
