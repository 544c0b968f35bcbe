"""The compiled functions against what numpy lays out: every byte, and every refusal."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.recording import chunk, message_index
from hub.recording.chunk import FIRST_BLOCK, Queued
from hub.recording.vector_block import VectorBlock
from schemas.vectors import VectorCodec
from tests.strategies import ports

pytestmark = pytest.mark.skipif(chunk.compiled is None, reason="built without a compiler")

TIMES = st.integers(0, 2**31 * 10**9 - 1)


@st.composite
def queues(draw: st.DrawFn) -> tuple[list[Queued], list[VectorBlock]]:
    codecs = [VectorCodec(port) for port in draw(st.lists(ports(), min_size=1, max_size=6))]
    channels = draw(st.lists(st.integers(1, 2**16 - 1), min_size=6, max_size=6, unique=True))
    cut = draw(st.integers(0, len(codecs)))
    numbered = list(zip(channels, codecs, strict=False))
    blocks = [VectorBlock(part) for part in (numbered[:cut], numbered[cut:]) if part]
    message = st.tuples(st.integers(1, 2**16 - 1), TIMES, st.binary(max_size=40))
    vectors = [
        st.tuples(st.just(FIRST_BLOCK + i), TIMES, st.binary(min_size=size, max_size=size))
        for i, size in enumerate(block.layout[1] for block in blocks)
    ]
    return draw(st.lists(st.one_of(message, *vectors), min_size=1, max_size=12)), blocks


@given(queues())
def test_records_and_indexes_are_the_same_bytes(drawn: tuple[list[Queued], list[VectorBlock]]) -> None:
    queued, blocks = drawn
    found, expected = chunk.chunk_data(queued, blocks), chunk._by_numpy(queued, blocks)
    assert found.records == expected.records
    for name in ("channels", "times_ns", "offsets"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    index, other = message_index.message_index(found), message_index._by_numpy(expected)
    assert index.records == other.records
    for one, another in zip(index[1:], other[1:], strict=True):
        assert np.array_equal(one, another)


@pytest.mark.parametrize(
    ("entry", "error"),
    [
        ((1, -1, b""), OverflowError),
        ((1, 2**64, b""), OverflowError),
        ((FIRST_BLOCK, 0, b"short"), ValueError),
        ((FIRST_BLOCK + 1, 0, b""), ValueError),
        ((1, 0), TypeError),
        ((1, 0, "text"), TypeError),
        ("no tuple", TypeError),
    ],
)
def test_what_is_no_entry_is_refused(entry, error):
    with pytest.raises(error):
        chunk.compiled.lay_out([entry], [(b"", 8, b"", b"", b"", b"")], FIRST_BLOCK)


def test_what_is_no_layout_or_index_is_refused():
    with pytest.raises(TypeError):
        chunk.compiled.lay_out([], [("text",) * 6], FIRST_BLOCK)
    one, two = np.zeros(1, np.int64), np.zeros(2, np.int64)
    with pytest.raises(ValueError, match="same messages"):
        chunk.compiled.index(one, two, one)
    for channel in (-1, 2**16):
        with pytest.raises(ValueError, match="16 bits"):
            chunk.compiled.index(one + channel, one, one)


def test_without_messages_there_is_no_record():
    assert chunk.compiled.lay_out([], [], FIRST_BLOCK) == (b"", b"")
    empty = np.empty(0, np.int64)
    assert chunk.compiled.index(empty, empty, empty) == (b"", b"")


def test_a_message_is_as_the_format_has_it():
    records, places = chunk.compiled.lay_out([(7, 5, b"abc")], [], FIRST_BLOCK)
    assert records == struct.pack("<BQHIQQ", 5, 25, 7, 0, 5, 5) + b"abc"
    assert np.frombuffer(places, np.int64).tolist() == [7, 5, 0]
