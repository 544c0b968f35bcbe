from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.session import clock as module
from hub.session.clock import Clock
from tests.hub.parts import Part, Stylus, into, out, plan_of

MS = 1_000_000


def plan(*periods):
    """A plan with participants of these periods that listen to a device."""
    listeners = [Part(f"p{period}", into()) for period in periods]
    specs = {f"p{period}": {"period": f"{period} ms"} for period in periods}
    return plan_of(
        Stylus("s", out()),
        Part("other", out()),
        *listeners,
        specs=specs,
        connections=[f"s.out -> p{period}.in" for period in periods],
    )


@given(st.sets(st.integers(1, 6), max_size=3), st.integers(1, 12), st.integers(1, 60), st.data())
def test_grants_cover_all_steps_and_end_where_a_listener_begins_a_step(periods, window, steps, data):
    clock = Clock(plan(*periods), window=window, realtime=False, steps=steps)
    clock.start()
    while not clock.done:
        most = data.draw(st.none() | st.integers(1, 12))
        count = clock.horizon(most)
        assert 1 <= count <= min(window, most or window, steps - clock.step)
        inside = range(clock.step + 1, clock.step + count)
        assert not any(step % period == 0 for step in inside for period in periods)
        clock.advance(count)
        assert clock.time_ns == clock.step * MS
    assert clock.step == steps
    assert clock.late_steps == 0


def test_a_run_without_an_end_is_never_done():
    clock = Clock(plan(), window=10, realtime=False, steps=None)
    clock.advance(10**6)
    assert not clock.done
    assert clock.horizon() == 10


@pytest.mark.parametrize(
    ("step", "realtime", "host", "count"),
    [
        ("1 ms", False, "hub", 10),
        ("4 ms", False, "hub", 2),
        ("20 ms", False, "hub", 1),
        ("1 ms", True, "hub", 1),
        ("1 ms", False, "far", 1),
    ],
)
def test_a_grant_covers_10_ms_by_default_where_nothing_enters(step, realtime, host, count):
    quiet = plan_of(Part("one", out()), Part("other", out()), specs={"other": {"host": host}}, step=step)
    assert Clock(quiet, window=None, realtime=realtime, steps=None).horizon() == count


@pytest.fixture
def wall(monkeypatch):
    """A wall clock that a test moves."""
    now: dict[str, Any] = {"ns": 10**12}
    monkeypatch.setattr(module, "monotonic_ns", lambda: now["ns"])
    monkeypatch.setattr(module, "sleep", lambda s: now.update(ns=now["ns"] + round(s * 1e9)))
    return now


def test_in_real_time_a_step_waits_for_the_wall_clock(wall):
    clock = Clock(plan(), window=1, realtime=True, steps=None)
    clock.start()
    begun = wall["ns"]
    for step in range(1, 6):
        wall["ns"] += MS // 4  # computing
        clock.advance(1)
        assert wall["ns"] == begun + step * MS
    assert clock.late_steps == 0


def test_a_late_step_is_counted_and_the_next_ones_catch_up(wall):
    clock = Clock(plan(), window=1, realtime=True, steps=None)
    clock.start()
    begun = wall["ns"]
    wall["ns"] += 5 * MS
    for _ in range(4):
        clock.advance(1)
        assert wall["ns"] == begun + 5 * MS
    for step in range(5, 8):
        clock.advance(1)
        assert wall["ns"] == begun + step * MS
    assert clock.late_steps == 4


def test_time_slips_where_there_is_too_much_to_catch_up(wall):
    clock = Clock(plan(), window=1, realtime=True, steps=None)
    clock.start()
    wall["ns"] += 1001 * MS
    resumed = wall["ns"]
    steps = 0
    while wall["ns"] == resumed:
        clock.advance(1)
        steps += 1
    assert steps == 52  # 50 ms are caught up
    assert clock.late_steps == 50


def test_slow_simulated_time_is_reported_where_a_device_leads(wall, caplog):
    for led, reports in ((plan(1), 2), (plan(), 0)):
        clock = Clock(led, window=1, realtime=True, steps=None)
        clock.start()
        for _ in range(20_000):
            wall["ns"] += 5 * MS  # what a step of 1 ms takes here
            clock.advance(1)
        found = [record.getMessage() for record in caplog.records]
        assert len(found) == reports
        assert all("simulated time runs at 0.2" in one for one in found)
        caplog.clear()


def test_simulated_time_that_slips_once_is_not_slow(wall, caplog):
    clock = Clock(plan(1), window=1, realtime=True, steps=None)
    clock.start()
    for step in range(20_000):
        wall["ns"] += 600 * MS if step % 6000 == 3000 else 0
        clock.advance(1)
    assert clock.late_steps
    assert not caplog.records


def test_a_pause_is_not_late(wall):
    clock = Clock(plan(), window=1, realtime=True, steps=None)
    clock.start()
    clock.advance(1)
    wall["ns"] += 10**10
    clock.start()
    resumed = wall["ns"]
    clock.advance(1)
    assert clock.late_steps == 0
    assert wall["ns"] == resumed + MS


def test_as_fast_as_possible_never_waits(wall):
    clock = Clock(plan(), window=1, realtime=False, steps=None)
    clock.start()
    begun = wall["ns"]
    clock.advance(100)
    assert wall["ns"] == begun
