from __future__ import annotations

import subprocess
import sys
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.haptics.contact import Plane
from devices.haptics.servo import exchange
from devices.haptics.servo.exchange import (
    STYLUS_BYTES,
    RingReader,
    RingWriter,
    State,
    device_ends,
    model_doubles,
    planes_in,
    ring_size,
    servo_ends,
)

SLOTS, DOUBLES = 4, 3
finite = st.floats(allow_nan=False)
planes = st.lists(st.builds(Plane, *[finite] * 8), max_size=4)

HAMMER = """
import sys
from devices.haptics.servo.exchange import RingWriter, attach, ring_size
ring = RingWriter(memoryview(attach(int(sys.argv[1]), ring_size(2, 40))), 2, 40)
print(flush=True)
number = 0.0
while True:
    number += 1.0
    ring.write([number] * 40)
"""


def _ring() -> tuple[memoryview, RingWriter, RingReader]:
    memory = memoryview(bytearray(ring_size(SLOTS, DOUBLES)))
    return memory, RingWriter(memory, SLOTS, DOUBLES), RingReader(memory, SLOTS, DOUBLES)


@given(bursts=st.lists(st.integers(0, 3 * SLOTS)))
def test_a_reader_gets_each_record_once_in_order_and_misses_only_what_is_overwritten(
    bursts: list[int],
) -> None:
    _, writer, reader = _ring()
    written = 0
    for burst in bursts:
        fresh = [[float(written + i), 0.5, -1.0] for i in range(burst)]
        for record in fresh:
            writer.write(record)
        written += burst
        assert reader.read() == [tuple(record) for record in fresh[-SLOTS:]]
    assert reader.read() == []


@given(at=st.integers(8, ring_size(SLOTS, DOUBLES) - 1), flip=st.integers(1, 255))
def test_a_record_that_is_being_overwritten_is_recognised(at: int, flip: int) -> None:
    memory, writer, reader = _ring()
    for number in range(SLOTS):
        writer.write([float(number)] * DOUBLES)
    memory[at] ^= flip
    slot = (at - 8) // (16 + 8 * DOUBLES)
    padding = 12 <= (at - 8) % (16 + 8 * DOUBLES) < 16
    torn = None if padding else (slot - 1) % SLOTS
    assert reader.read() == [(float(number),) * DOUBLES for number in range(SLOTS) if number != torn]


def test_a_writer_that_dies_half_way_leaves_the_record_before() -> None:
    memory, writer, reader = _ring()
    writer.write([1.0] * DOUBLES)
    writer.write([2.0] * DOUBLES)
    third = 8 + 3 * (16 + 8 * DOUBLES)
    memory[third : third + 20] = b"\x03" * 20  # a slot begun, the counter not yet moved
    assert reader.read() == [(1.0,) * DOUBLES, (2.0,) * DOUBLES]
    again = RingWriter(memory, SLOTS, DOUBLES)
    again.write([3.0] * DOUBLES)
    assert reader.read() == [(3.0,) * DOUBLES]


@pytest.mark.long
def test_no_torn_record_gets_through_while_another_process_writes_as_fast_as_it_can() -> None:
    shared, handle = exchange.create(ring_size(2, 40))
    assert isinstance(handle, int)
    process = subprocess.Popen(
        [sys.executable, "-c", HAMMER, str(handle)], pass_fds=(handle,), stdout=subprocess.PIPE
    )
    try:
        assert process.stdout
        process.stdout.readline()
        reader = RingReader(memoryview(shared), 2, 40)
        last, whole = 0.0, 0
        while whole < 5000:
            for record in reader.read():
                assert record == (record[0],) * 40
                assert record[0] > last
                last, whole = record[0], whole + 1
    finally:
        process.kill()
        process.communicate()
    assert last > 5000


@given(model=planes, stamp=st.integers(0, 2**53), arrived=finite)
def test_contact_models_cross_unchanged(model: list[Plane], stamp: int, arrived: float) -> None:
    memory = memoryview(bytearray(2 * STYLUS_BYTES))
    (writer, _), (reader, _) = device_ends(memory, 1), servo_ends(memory, 1)
    writer.write(model_doubles(model, stamp, arrived))
    (record,) = reader.read()
    assert (record[0], int(record[1]), planes_in(record)) == (arrived, stamp, model)


def test_states_cross_unchanged_and_styluses_do_not_mix() -> None:
    memory = memoryview(bytearray(2 * STYLUS_BYTES))
    state = State(
        1.5,
        3,
        0x203,
        2,
        1,
        4,
        (1.0, 2.0, 3.0),
        tuple(range(9)),
        (4.0, 5.0, 6.0),
        (7.0, 8.0, 9.0),
        (0.1, 0.2, -inf),
    )
    _, writer = servo_ends(memory, 1)
    writer.write([*state[:6], *state.position, *state.rotation, *state.linear, *state.angular, *state.force])
    assert [State.of(record) for record in device_ends(memory, 1)[1].read()] == [state]
    assert device_ends(memory, 0)[1].read() == []
