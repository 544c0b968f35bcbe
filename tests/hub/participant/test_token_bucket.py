import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.participant.token_bucket import TokenBucket

S = 10**9


@given(st.lists(st.integers(0, S // 10), min_size=1, max_size=300), st.floats(0.1, 1e4))
def test_at_most_a_second_of_messages_at_once_and_then_the_rate(pauses, rate):
    bucket, now, spent = TokenBucket(rate), 17 * S, 0
    for pause in pauses:
        now += pause
        spent += bucket.spend(now)
    assert spent <= max(rate, 1.0) + rate * sum(pauses) / S + 1e-6


def test_a_flood_is_held_to_the_rate_and_messages_within_the_rate_all_pass():
    bucket = TokenBucket(100.0)
    assert sum(bucket.spend(5 * S + i * 100_000) for i in range(30_000)) == pytest.approx(
        100 + 3 * 100, abs=2
    )
    bucket = TokenBucket(100.0)
    assert all(bucket.spend(5 * S + i * 10_000_000) for i in range(1000))


def test_a_burst_may_be_smaller_than_what_a_second_brings():
    bucket = TokenBucket(1500.0, burst=150.0)
    assert sum(bucket.spend(5 * S) for _ in range(1000)) == 150
    assert sum(bucket.spend(5 * S + S // 100) for _ in range(1000)) == 15
