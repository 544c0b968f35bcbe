"""Which value a reader sees, against a model that lists all of them."""

from bisect import bisect_right
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.transport.cells import INITIAL, Cell, RemoteCell
from schemas.errors import SessionError

STEPS = 40
sources = st.tuples(st.integers(1, 5), st.integers(1, 4)).map(lambda pair: (pair[0], pair[0] * pair[1]))
"""Period of a source, and the distance of two of its values."""


def made(period, stride):
    """The tags of all values, and the communication points at which each is valid."""
    tags = [step for step in range(0, STEPS, period) if (step + period) % stride == 0]
    return [INITIAL, *tags], [0, *(tag + period for tag in tags)]


@given(sources, st.integers(0, STEPS - 10))
def test_a_reader_sees_the_newest_value_that_is_begun_or_completed(source, step):
    cell, (tags, valid) = Cell(*source, depth=1), made(*source)
    assert cell.tag(step, fresh=True) == tags[bisect_right(tags, step) - 1]
    assert cell.tag(step, fresh=False) == tags[bisect_right(valid, step) - 1]


@given(sources)
def test_values_follow_one_another(source):
    cell, (tags, valid) = Cell(*source, depth=1), made(*source)
    for before, tag in pairwise(tags):
        assert cell.after(before) == tag
        assert cell.before(tag) == before
    assert cell.before(INITIAL) == INITIAL
    assert [cell.valid_from(tag) for tag in tags] == valid


@given(st.integers(2, 5))
def test_a_cell_keeps_as_many_values_as_readers_look_back_and_copies_them(depth):
    cell, owned = Cell(1, 1, depth), np.zeros(1)
    for tag in range(10):
        owned[0] = tag
        cell.put(tag, owned)
    assert [cell.get(tag)[0] for tag in range(10 - depth, 10)] == list(range(10 - depth, 10))
    with pytest.raises(KeyError):
        cell.get(9 - depth)


class Script:
    """Gives values in the order in which they are written down."""

    def __init__(self, tags):
        self._tags = list(tags)

    def receive(self):
        return self.poll()

    def poll(self):
        return (tag := self._tags.pop(0), tag * 10) if self._tags else None


@given(sources, st.integers(0, 3), st.booleans(), st.integers(1, 4))
def test_a_remote_cell_gives_what_a_local_one_would(source, repetitions, fresh, reader_period):
    tags, _ = made(*source)
    cell = RemoteCell(*source, 2, Script([INITIAL] * repetitions + tags))
    assert cell.has_initial_value()
    for step in range(0, STEPS - 10, reader_period):
        tag = cell.tag(step, fresh=fresh)
        assert cell.get(tag) == tag * 10
    assert not cell.waiting


def test_a_remote_cell_is_primed_by_the_value_at_time_0_only():
    cell = RemoteCell(1, 1, 1, Script([]))
    assert not cell.has_initial_value()
    assert RemoteCell(1, 1, 1, Script([INITIAL])).has_initial_value()


def test_a_lost_value_is_an_error():
    cell = RemoteCell(1, 1, 1, Script([INITIAL, 0, 2]))
    assert cell.get(0) == 0
    with pytest.raises(SessionError, match="the value of step 1 was lost: that of step 2 arrived instead"):
        cell.get(1)
