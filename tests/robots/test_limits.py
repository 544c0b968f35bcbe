from math import nan, nextafter

from hypothesis import given
from hypothesis import strategies as st

from robots.limits import distinct

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def test_six_digits_unless_more_are_needed():
    assert distinct(2.0, -0.698132, 1.39626) == ["2", "-0.698132", "1.39626"]
    assert distinct(1.3962634, -0.698132, 1.39626) == ["1.396263", "-0.698132", "1.39626"]
    assert distinct(0.5001, 0.5, digits=3) == ["0.5001", "0.5"]
    assert distinct(nan, 1.0) == ["nan", "1"]


@given(NUMBERS)
def test_neighbours_differ(limit):
    value, written = distinct(nextafter(limit, 2e308), limit)
    assert value != written


@given(NUMBERS, NUMBERS)
def test_numbers_that_differ_are_written_differently(value, limit):
    first, second = distinct(value, limit)
    assert first != second or value == limit
