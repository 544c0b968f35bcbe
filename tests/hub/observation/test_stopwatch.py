import pytest

from hub.observation import stopwatch
from hub.observation.stopwatch import Phase, Stopwatch


class Clock:
    """Stands for both clocks: the thread has a core half of the time."""

    def __init__(self, monkeypatch):
        self.ns = 0
        monkeypatch.setattr(stopwatch, "perf_counter_ns", lambda: self.ns)
        monkeypatch.setattr(stopwatch, "thread_time_ns", lambda: self.ns // 2)


class Part:
    def __init__(self, clock):
        self.clock = clock

    def inner(self):
        self.clock.ns += 30

    def outer(self):
        self.clock.ns += 10
        self.inner()
        self.clock.ns += 5
        return "late"

    def fail(self):
        self.clock.ns += 7
        raise ArithmeticError


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


def walls(watch):
    return {name: phase.wall_ns for name, phase in watch.phases.items()}


def test_every_moment_belongs_to_one_phase(clock):
    watch, part = Stopwatch(Phase("between", "hub")), Part(clock)
    watch.time(part.inner, watch.phase("inner", "a"))
    watch.time(part.outer, watch.phase("outer", "b"))
    clock.ns += 100
    assert part.outer() == "late"
    clock.ns += 3
    part.inner()
    assert walls(watch) == {"between": 103, "inner": 60, "outer": 15}


def test_what_follows_a_method_may_have_a_phase_of_its_own(clock):
    watch, part = Stopwatch(Phase("between", "hub")), Part(clock)
    watch.time(part.inner, watch.phase("inner", "a"), then=watch.phase("after", "b"))
    part.inner()
    clock.ns += 9
    part.inner()
    assert walls(watch) == {"between": 0, "inner": 60, "after": 9}


def test_the_result_may_say_which_phase_it_was(clock):
    watch, part = Stopwatch(Phase("between", "hub")), Part(clock)
    watch.time_by_result(part.outer, watch.phase("wait", "a"), lambda result: watch.phase(result, "b"))
    part.outer()
    assert walls(watch) == {"between": 0, "wait": 0, "late": 45}


def test_a_method_that_raises_is_counted(clock):
    watch, part = Stopwatch(Phase("between", "hub")), Part(clock)
    watch.time(part.fail, watch.phase("fail", "a"))
    with pytest.raises(ArithmeticError):
        part.fail()
    clock.ns += 1
    watch.next_round()
    assert walls(watch) == {"between": 1, "fail": 7}


def test_a_round_has_times_of_its_own_and_one_in_seven_reads_the_clock_of_the_thread(clock, monkeypatch):
    watch, part = Stopwatch(Phase("between", "hub")), Part(clock)
    inner = watch.phase("inner", "a")
    watch.time(part.inner, inner)
    read = 0

    def thread_time_ns():
        nonlocal read
        read += 1
        return clock.ns // 2

    monkeypatch.setattr(stopwatch, "thread_time_ns", thread_time_ns)
    reads = []
    for _ in range(14):
        read = 0
        part.inner()
        assert watch.round_ns()[inner] == 30
        watch.next_round()
        reads.append(read)
    assert [count > 1 for count in reads] == ([False] * 3 + [True] + [False] * 3) * 2
    assert inner.sampled_ns == 2 * 15
    watch.restart()
    assert walls(watch) == {"between": 0, "inner": 0}


def test_only_methods_of_objects_can_be_timed(clock):
    with pytest.raises(TypeError, match="not a method"):
        Stopwatch(Phase("between", "hub")).time(len, Phase("a", "a"))
