"""Records of state: exact, checked, and fast enough to be read in every step."""

from __future__ import annotations

import struct
from enum import IntEnum

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    choice,
    flag,
    integer,
    number,
    state_hash,
)
from schemas.errors import StateError
from schemas.ports import Port
from schemas.vectors import Vector


class Phase(IntEnum):
    UNKNOWN = -1
    REST = 0
    MOVE = 2


class Sample(Record):
    position = array("n")
    phase = choice(Phase.UNKNOWN)
    elapsed = number(0.5)
    axes = array(2, "n")
    pending = flag(start=True)
    count = integer(7)


class Sampler(Controller):
    def __init__(self, n: int = 3) -> None:
        super().__init__("sampler", Params())
        self.sample, self.table = Sample(n=n), np.zeros((2, 2))
        self.keep(self.sample, self.table)

    @property
    def ports(self) -> tuple[Port, ...]:
        return ()

    def configure(self, setup: Setup) -> Outputs:
        return {}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        return {}


def bits(value: float) -> bytes:
    return struct.pack("d", value)


def from_bits(pattern: int) -> float:
    return struct.unpack("d", pattern.to_bytes(8, "little"))[0]


ANY_BITS = st.integers(0, 2**64 - 1).map(from_bits)
"""Every float64 there is: NaN with payloads, -0.0, subnormals."""
ODD = [0.0, -0.0, 5e-324, float("inf"), from_bits(0x7FF8_0000_DEAD_BEEF), from_bits(0xFFF0_0000_0000_0001)]
FLOATS = st.one_of(st.floats(), st.sampled_from(ODD), ANY_BITS)


def test_fields_have_their_types_and_start_values() -> None:
    sample = Sample(n=3)
    assert sample.phase is Phase.UNKNOWN
    assert sample.pending is True
    assert isinstance(sample.count, int)
    assert (sample.elapsed, sample.count) == (0.5, 7)
    assert (sample.position.shape, sample.axes.shape) == ((3,), (2, 3))
    assert sample.values.tolist() == [0.0] * 3 + [-1.0, 0.5] + [0.0] * 6 + [1.0, 7.0]


def test_arrays_are_views_that_are_written_in_place() -> None:
    sample = Sample(n=3)
    view = sample.position
    view[:] = 1.0, 2.0, 3.0
    sample.axes[1] = 4.0
    assert sample.values[:3].tolist() == [1.0, 2.0, 3.0]
    sample.position = np.array([5.0, 6.0, 7.0])
    assert sample.position is view
    assert view.tolist() == [5.0, 6.0, 7.0]
    sample.position += 1.0
    assert sample.values.tolist() == [6.0, 7.0, 8.0, -1.0, 0.5, 0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 1.0, 7.0]


def test_a_number_has_a_view_for_an_output() -> None:
    sample = Sample(n=3)
    elapsed = sample.part("elapsed")
    sample.elapsed = 2.5
    assert elapsed.tolist() == [2.5]
    assert (sample.part("count").tolist(), sample.part("axes").shape) == ([7.0], (6,))
    assert np.shares_memory(sample.part("position"), sample.values)


def test_records_of_one_class_may_differ_in_size_and_share_nothing() -> None:
    small, large = Sample(n=1), Sample(n=8)
    small.phase, large.phase = Phase.REST, Phase.MOVE
    assert (small.phase, large.phase) == (Phase.REST, Phase.MOVE)
    assert (small.values.size, large.values.size) == (7, 28)


def test_a_subclass_adds_its_fields_after_those_of_its_base() -> None:
    class Longer(Sample):
        late = flag()

    longer = Longer(n=1)
    longer.late = True
    assert longer.values.tolist() == [0.0, -1.0, 0.5, 0.0, 0.0, 1.0, 7.0, 1.0]


def test_a_record_may_be_empty() -> None:
    assert Record().values.size == 0


def test_a_field_cannot_hide_what_records_have() -> None:
    with pytest.raises(TypeError, match="values cannot be the name of a field"):
        type("Wrong", (Record,), {"values": array(1)})


@given(
    position=st.lists(FLOATS, min_size=3, max_size=3),
    phase=st.sampled_from(Phase),
    elapsed=FLOATS,
    pending=st.booleans(),
    count=st.integers(-(2**53), 2**53),
    table=st.lists(FLOATS, min_size=4, max_size=4),
)
def test_what_is_saved_is_restored_bit_for_bit(
    position: list[float], phase: Phase, elapsed: float, pending: bool, count: int, table: list[float]
) -> None:
    one, other = Sampler(), Sampler()
    sample = one.sample
    sample.position, one.table[...] = np.array(position), np.reshape(table, (2, 2))
    sample.phase, sample.elapsed, sample.pending, sample.count = phase, elapsed, pending, count
    other.restore(one.save())
    again = other.sample
    assert [bits(value) for value in again.position.tolist()] == [bits(value) for value in position]
    assert (again.phase, bits(again.elapsed), again.pending, again.count) == (
        phase,
        bits(elapsed),
        pending,
        count,
    )
    assert other.table.tobytes() == struct.pack("4d", *table)
    assert (other.save(), other.state_hash()) == (one.save(), one.state_hash())


@given(values=st.lists(FLOATS, min_size=17, max_size=17))
def test_any_bytes_are_restored_exactly_or_refused_and_nothing_is_changed(values: list[float]) -> None:
    sampler = Sampler()
    before, state = sampler.save(), struct.pack("17d", *values)
    try:
        sampler.restore(state)
    except StateError:
        assert sampler.save() == before
    else:
        assert sampler.save() == state
        sample = sampler.sample
        repeated = (sample.phase, sample.elapsed, sample.pending, sample.count)
        sample.phase, sample.elapsed, sample.pending, sample.count = repeated
        assert sampler.save() == state


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (3, 1.0, r"Sample.phase = 1, allowed are -1 \(UNKNOWN\), 0 \(REST\), 2 \(MOVE\)"),
        (3, -0.0, "Sample.phase = -0, allowed"),
        (3, float("nan"), "Sample.phase = nan"),
        (11, 0.5, r"Sample.pending = 0.5, allowed are 0 \(False\) and 1 \(True\)"),
        (11, -0.0, "Sample.pending = -0"),
        (12, 1.5, r"Sample.count = 1.5, allowed are whole numbers from -2\^53 to 2\^53"),
        (12, 2.0**54, "Sample.count = 1.80144e[+]16"),
        (12, float("inf"), "Sample.count = inf"),
        (12, float("nan"), "Sample.count = nan"),
    ],
)
def test_a_value_that_a_field_cannot_have_is_refused(place: int, value: float, message: str) -> None:
    sampler = Sampler()
    values: Vector = np.frombuffer(sampler.save()).copy()
    values[place] = value
    before = sampler.save()
    with pytest.raises(StateError, match=f"participant 'sampler'.*{message}"):
        sampler.restore(values.tobytes())
    assert sampler.save() == before


def test_a_state_of_another_size_is_refused() -> None:
    with pytest.raises(StateError, match="a saved state of 136 bytes, expected 160; was it saved elsewhere"):
        Sampler(4).restore(Sampler(3).save())


def test_an_integer_that_float64_cannot_hold_is_refused_when_it_is_set() -> None:
    sample = Sample(n=1)
    with pytest.raises(StateError, match=r"Sample.count = 9007199254740993, allowed are whole numbers"):
        sample.count = 2**53 + 1
    assert sample.count == 7


def test_the_hash_is_that_of_the_bytes_in_order() -> None:
    sampler = Sampler()
    sampler.table[0, 1] = 3.0
    assert sampler.state_hash() == state_hash(sampler.save())
    sampler.keep(sampler.table)
    assert sampler.state_hash() == state_hash(sampler.table)
    sampler.close()


def test_a_controller_without_state_can_be_saved() -> None:
    sampler = Sampler()
    sampler.keep()
    sampler.restore(sampler.save())
    assert sampler.save() == b""
