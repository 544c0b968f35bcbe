import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.devices.clock_offset import ClockExchange, ClockOffset

S, MS = 10**9, 10**6


def exchange(asked, offset, there, back, thinking=1000):
    received = asked + there + offset
    return ClockExchange(asked, received, received + thinking, asked + there + thinking + back)


@given(st.integers(-(10**15), 10**15), st.integers(0, 50 * MS), st.integers(0, 50 * MS))
def test_an_offset_is_right_within_half_a_round_trip(offset, there, back):
    one = exchange(10 * S, offset, there, back)
    assert one.round_trip_ns == there + back
    assert abs(one.offset_ns - offset) <= (there + back) / 2 + 1


def test_the_fastest_of_the_last_exchanges_counts():
    clocks, chance, offset = ClockOffset(), random.Random(1), 123 * S
    assert clocks.best is None
    for i in range(100):
        clocks.add(
            exchange(
                i * S // 2,
                offset,
                100_000 + round(chance.expovariate(1e-6)),
                100_000 + round(chance.expovariate(1e-6)),
            )
        )
    best = clocks.best
    assert abs(best.offset_ns - offset) < 0.3 * MS
    assert best.round_trip_ns < 1 * MS


def test_clocks_that_drift_apart_are_followed():
    clocks = ClockOffset()
    for i in range(600):
        now = i * S // 2
        clocks.add(exchange(now, round(10e-6 * now), 200_000, 200_000 + (0 if i % 10 else -150_000)))
    assert clocks.best.offset_ns == pytest.approx(10e-6 * 300 * S, abs=0.2 * MS)


@pytest.mark.parametrize("jump", [-3 * S, 7 * S])
def test_a_clock_that_jumps_is_followed_at_once(jump):
    clocks = ClockOffset()
    for i in range(20):
        clocks.add(exchange(i * S, 0, MS, MS))
    clocks.add(exchange(20 * S, jump, 5 * MS, 5 * MS))
    assert abs(clocks.best.offset_ns - jump) <= 5 * MS
