"""`plain_sum` adds from the first value to the last, as `sum` did before Python 3.12."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from schemas.plain_sum import plain_sum


@given(st.lists(st.floats(allow_nan=False)))
def test_it_adds_in_order_with_the_rounding_of_each_addition(values):
    total = 0.0
    for value in values:
        total += value
    assert struct.pack("d", plain_sum(values)) == struct.pack("d", total)


def test_rounding_errors_are_not_compensated():
    assert plain_sum([1e16, 1.0, -1e16]) == 0.0
