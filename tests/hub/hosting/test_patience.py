import os
import sys
from time import sleep

import pytest

from hub.hosting import patience as patience_module
from hub.hosting.patience import Patience
from tests.hub.busy_processes import busy_processes


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test moves, and the run delay of one thread."""

    class Clock:
        now_ns = 0
        delay_ns = 0
        looks = 0

        def advance(self, seconds, *, delayed=0.0):
            self.now_ns += round(seconds * 1e9)
            self.delay_ns += round(delayed * 1e9)

        def run_delays(self, _):
            self.looks += 1
            return {"thread": self.delay_ns}

    clock = Clock()
    monkeypatch.setattr(patience_module, "monotonic_ns", lambda: clock.now_ns)
    monkeypatch.setattr(patience_module, "_run_delays", clock.run_delays)
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


def test_the_processes_are_looked_at_every_tenth_of_a_second(clock):
    patience = Patience(3 * 10**9)
    while not patience.is_over([1]):
        clock.advance(0.001)
    assert clock.now_ns == pytest.approx(3.1e9, abs=0.002e9)
    assert clock.looks == 27


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
