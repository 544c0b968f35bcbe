import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.transport.rate_limit import RateLimit

S = 10**9


@given(st.lists(st.integers(0, S // 10), min_size=1, max_size=300), st.floats(0.1, 1e4))
def test_at_most_the_messages_of_a_second_at_once_and_then_the_rate(pauses, rate):
    limit, now, spent = RateLimit(rate), 17 * S, 0
    for pause in pauses:
        now += pause
        spent += limit.allow(now)
    assert spent <= max(rate, 1.0) + rate * sum(pauses) / S + 1e-6


def test_a_flood_is_limited_to_the_rate_and_a_slower_stream_is_not_limited():
    limit = RateLimit(100.0)
    assert sum(limit.allow(5 * S + i * 100_000) for i in range(30_000)) == pytest.approx(100 + 3 * 100, abs=2)
    limit = RateLimit(100.0)
    assert all(limit.allow(5 * S + i * 10_000_000) for i in range(1000))
