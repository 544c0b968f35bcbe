"""Intervals and tests of success rates, against known values and by their properties."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from learning.judge.intervals import paired_difference, success_rate

OUTCOMES = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60)


def test_wilson():
    rate = success_rate(8, 10)
    # by the closed form of Wilson (1927), z = 1.959964
    assert (rate.low, rate.high) == pytest.approx((0.49016, 0.94331), abs=1e-5)
    assert str(success_rate(0, 0)) == "0 of 0 (0.00 to 1.00)"


@given(st.integers(1, 200).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_an_interval_holds_its_rate(counts):
    rate = success_rate(*counts)
    assert 0.0 <= rate.low <= rate.value <= rate.high <= 1.0
    mirrored = success_rate(counts[1] - counts[0], counts[1])
    assert (1.0 - mirrored.high, 1.0 - mirrored.low) == pytest.approx((rate.low, rate.high))


def test_pairs():
    first = [True] * 36 + [False] * 12 + [True] * 2 + [False] * 4
    second = [True] * 36 + [True] * 12 + [False] * 2 + [False] * 4
    found = paired_difference(first, second)
    assert (found.pairs, found.only_first, found.only_second) == (54, 2, 12)
    assert found.difference == pytest.approx(10 / 54)
    # 2 sum of C(14, k) / 2^14 for k up to 2
    assert found.p == pytest.approx(2 * (1 + 14 + 91) / 2**14)
    assert found.is_real
    # by hand, with phi = (144 - 24 - 27) / sqrt(48 6 38 16)
    assert (found.low, found.high) == pytest.approx((0.05056, 0.31728), abs=1e-5)


@given(OUTCOMES)
def test_the_difference_turns_round(pairs):
    first, second = ([pair[i] for pair in pairs] for i in (0, 1))
    found, turned = paired_difference(first, second), paired_difference(second, first)
    assert found.low - 1e-12 <= found.difference <= found.high + 1e-12
    assert (turned.low, turned.high, turned.p) == pytest.approx((-found.high, -found.low, found.p))


@given(st.lists(st.booleans(), min_size=1, max_size=40))
def test_a_policy_does_not_differ_from_itself(outcomes):
    found = paired_difference(outcomes, outcomes)
    assert (found.difference, found.p, found.is_real) == (0.0, 1.0, False)
