"""Reliable transfer of RTPS: with datagrams lost, doubled or reordered, samples arrive once and in order."""

import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.ros.dds.rtps import (
    PL_CDR_LE,
    AckNack,
    Data,
    Gap,
    Heartbeat,
    encode_acknack,
    encode_data,
    encode_heartbeat,
    encode_message,
    encode_parameters,
    encode_string,
    parse_message,
    parse_parameters,
)
from devices.ros.dds.stateful import StatefulReader, StatefulWriter
from schemas.errors import MessageError

US, THEM, WRITER, READER = bytes(range(12)), bytes(range(12, 24)), b"\x00\x00\x01\x03", b"\x00\x00\x01\x04"


class Air:
    """Carries datagrams both ways; loses, doubles and reorders them by `fates` until those are used up."""

    def __init__(self, fates):
        self.fates, self.flying = list(fates), []
        self.heard = []
        self.writer = StatefulWriter(lambda parts: self.fly("there", parts), WRITER, READER)
        self.reader = StatefulReader(
            lambda parts: self.fly("back", parts),
            READER,
            WRITER,
            lambda sample: self.heard.append(sample.payload),
        )

    def fly(self, way, parts):
        for part in parts:
            fate = self.fates.pop() if self.fates else "arrives"
            self.flying += [(way, part)] * {"lost": 0, "twice": 2}.get(fate, 1)
            if fate == "overtakes":
                self.flying.insert(0, self.flying.pop())

    def land(self):
        while self.flying:
            way, part = self.flying.pop(0)
            for it in parse_message(encode_message(US, THEM, [part]), THEM).submessages:
                if way == "back":
                    self.writer.on_acknack(it)
                else:
                    self.reader.receive(it)


@given(st.lists(st.sampled_from(["arrives", "lost", "twice", "overtakes"]), max_size=60), st.integers(1, 20))
def test_all_arrives_once_and_in_order(fates, count):
    air = Air(fates)
    sent = [bytes([number]) * 4 for number in range(count)]
    for payload in sent:
        air.writer.write(payload, {})
        air.land()
    for _ in range(70):  # a period of a second each
        air.writer.send_heartbeat()
        air.land()
    assert air.heard == sent
    air.writer.send_heartbeat()
    assert not air.flying, "all is acknowledged, and still asked for"


def test_irrelevant_samples_are_not_waited_for():
    air = Air([])
    air.reader.receive(Data(WRITER, READER, 5, {}, b"five"))
    assert air.heard == []
    air.reader.receive(Gap(WRITER, READER, 1, 4, (4,)))
    assert air.heard == [b"five"]
    air.reader.receive(Heartbeat(WRITER, READER, 9, 8, is_final=True))
    air.reader.receive(Data(WRITER, READER, 9, {}, b"nine"))
    assert air.heard == [b"five", b"nine"]


def test_an_acknack_of_base_0_is_answered_with_a_heartbeat():
    air = Air([])
    air.writer.on_acknack(AckNack(WRITER, READER, 0, ()))
    assert air.flying == [("there", encode_heartbeat(WRITER, READER, 1, 0, 1))]


@given(st.integers(1, 2**40), st.sets(st.integers(0, 255)))
def test_missing_numbers_survive_encoding(base, offsets):
    missing = tuple(sorted(base + offset for offset in offsets))
    (got,) = parse_message(
        encode_message(US, THEM, [encode_acknack(WRITER, READER, base, missing, 1)]), THEM
    ).submessages
    assert got == AckNack(WRITER, READER, base, missing)


@given(st.dictionaries(st.integers(2, 0xFFFF), st.binary(max_size=30)))
def test_parameters_survive_encoding(values):
    got, length = parse_parameters(encode_parameters(values) + b"rest")
    assert length == len(encode_parameters(values))
    assert {id_: value[: len(values[id_])] for id_, value in got.items()} == values


def test_a_sample_and_its_inline_qos_reach_the_participant_they_are_addressed_to():
    datagram = encode_message(
        US, THEM, [encode_data(WRITER, READER, 7, PL_CDR_LE + encode_string("a word!"), {0x83: bytes(24)})]
    )
    got = parse_message(datagram, THEM)
    assert got.guid_prefix == US
    assert got.submessages == (
        Data(WRITER, READER, 7, {0x83: bytes(24)}, PL_CDR_LE + encode_string("a word!")),
    )
    assert parse_message(datagram, US).submessages == ()


@given(st.binary(max_size=120))
def test_noise_is_refused(noise):
    for datagram in (noise, encode_message(US, THEM, [])[:20] + noise):
        with suppress(MessageError):
            parse_message(datagram, THEM)


def test_bytes_that_are_no_message_are_refused():
    with pytest.raises(MessageError, match="no message of RTPS"):
        parse_message(b"GIOP" + bytes(30), THEM)


SIZE, PIECE = 1000, 96
LARGE = bytes(range(250)) * 4
PIECES = -(-SIZE // PIECE)


def fragment(number, first, count=1, *, size=SIZE, content=None):
    """Return a DATA_FRAG of `LARGE`, written by the standard's figure and not by ours."""
    if content is None:
        content = LARGE[(first - 1) * PIECE : (first - 1 + count) * PIECE]
    head = struct.pack("<HH", 0, 28) + READER + WRITER + struct.pack("<iI", 0, number)
    body = head + struct.pack("<IHHI", first, count, PIECE, size) + content
    return struct.pack("<BBH", 0x16, 1, len(body)) + body


def parsed(submessage):
    (found,) = parse_message(encode_message(US, THEM, [submessage]), THEM).submessages
    return found


def requested(submessage):
    """Return sample and fragments of a NACK_FRAG."""
    kind, _, _, reader, writer, high, low, base, bits = struct.unpack_from("<BBH4s4siIII", submessage)
    assert (kind, reader, writer, high) == (0x12, READER, WRITER, 0)
    words = struct.unpack_from(f"<{(bits + 31) // 32}I", submessage, 28)
    return low, [base + bit for bit in range(bits) if words[bit // 32] >> (31 - bit % 32) & 1]


@given(st.lists(st.integers(1, PIECES), max_size=30), st.randoms(use_true_random=False))
def test_a_sample_in_fragments_is_put_together_and_what_is_missing_requested(arrived, random):
    sent, heard = [], []
    reader = StatefulReader(sent.extend, READER, WRITER, lambda sample: heard.append(sample.payload))
    for first in arrived:
        reader.receive(parsed(fragment(1, first)))
    reader.receive(Data(WRITER, READER, 2, {}, b"after it"))
    if set(arrived) != set(range(1, PIECES + 1)):
        assert heard == []
    while not heard:
        sent.clear()
        reader.receive(Heartbeat(WRITER, READER, 1, 2, is_final=False))
        acknack = parsed(sent[0])
        assert acknack.base == 1
        if acknack.missing:
            assert (acknack.missing, arrived) == ((1,), [])
            missing = list(range(1, PIECES + 1))
        else:
            number, missing = requested(sent[1])
            assert (number, missing) == (1, sorted(set(range(1, PIECES + 1)) - set(arrived)))
        for first in random.sample(missing, random.randint(1, len(missing))):
            arrived.append(first)
            reader.receive(parsed(fragment(1, first)))
    assert heard == [LARGE, b"after it"]


def test_fragments_that_fit_no_sample_are_refused_and_leave_no_trace():
    heard = []
    reader = StatefulReader(lambda parts: None, READER, WRITER, lambda sample: heard.append(sample.payload))
    for wrong in (
        fragment(1, 1, size=2**31),
        fragment(1, 0),
        fragment(1, 1, size=PIECE - 1),
        fragment(1, PIECES + 1, content=bytes(PIECE)),
        fragment(1, 2, content=b"short"),
    ):
        with pytest.raises(MessageError, match="fragments"):
            reader.receive(parsed(wrong))
    reader.receive(parsed(fragment(1, 1, size=SIZE + 1)))
    with pytest.raises(MessageError, match="do not fit a sample"):
        reader.receive(parsed(fragment(1, 2)))
    reader.receive(parsed(fragment(1, 1, PIECES)))
    assert heard == [LARGE]
