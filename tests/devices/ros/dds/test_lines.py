"""Reliable lines of DDS: whatever datagrams are lost, doubled or overtaken, samples arrive once and in order."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.ros.dds.lines import Receiving, Sending
from devices.ros.dds.rtps import (
    PL_CDR_LE,
    Acknack,
    Data,
    Gap,
    Heartbeat,
    acknack,
    data,
    heartbeat,
    message,
    parameters,
    read_parameters,
    received,
    text,
)
from schemas.errors import MessageError

US, THEM, WRITER, READER = bytes(range(12)), bytes(range(12, 24)), b"\x00\x00\x01\x03", b"\x00\x00\x01\x04"


class Air:
    """Carries datagrams both ways, and loses, doubles and reorders them as `fates` say, until they are used
    up.
    """

    def __init__(self, fates):
        self.fates, self.flying = list(fates), []
        self.heard = []
        self.sending = Sending(lambda parts: self.fly("there", parts), WRITER, READER)
        self.receiving = Receiving(
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
            for it in received(message(US, THEM, [part]), THEM).submessages:
                if way == "back":
                    self.sending.asked(it)
                else:
                    {Data: self.receiving.came, Heartbeat: self.receiving.beat, Gap: self.receiving.skip}[
                        type(it)
                    ](it)


@given(st.lists(st.sampled_from(["arrives", "lost", "twice", "overtakes"]), max_size=60), st.integers(1, 20))
def test_all_arrives_once_and_in_order(fates, count):
    air = Air(fates)
    sent = [bytes([number]) * 4 for number in range(count)]
    for payload in sent:
        air.sending.send(payload, {})
        air.land()
    for _ in range(70):  # a period of a second each
        air.sending.repeat()
        air.land()
    assert air.heard == sent
    air.sending.repeat()
    assert not air.flying, "all is acknowledged, and still asked for"


def test_what_never_comes_is_not_waited_for():
    air = Air([])
    air.receiving.came(Data(WRITER, READER, 5, {}, b"five"))
    assert air.heard == []
    air.receiving.skip(Gap(WRITER, READER, 1, 4, (4,)))
    assert air.heard == [b"five"]
    air.receiving.beat(Heartbeat(WRITER, READER, 9, 8, is_final=True))
    air.receiving.came(Data(WRITER, READER, 9, {}, b"nine"))
    assert air.heard == [b"five", b"nine"]


def test_a_reader_that_knows_nothing_yet_is_told_what_there_is():
    air = Air([])
    air.sending.asked(Acknack(WRITER, READER, 0, ()))
    assert air.flying == [("there", heartbeat(WRITER, READER, 1, 0, 1))]


@given(st.integers(1, 2**40), st.sets(st.integers(0, 255)))
def test_numbers_that_are_missing_come_over(base, offsets):
    missing = tuple(sorted(base + offset for offset in offsets))
    (got,) = received(message(US, THEM, [acknack(WRITER, READER, base, missing, 1)]), THEM).submessages
    assert got == Acknack(WRITER, READER, base, missing)


@given(st.dictionaries(st.integers(2, 0xFFFF), st.binary(max_size=30)))
def test_parameters_come_over(values):
    got, length = read_parameters(parameters(values) + b"rest")
    assert length == len(parameters(values))
    assert {id_: value[: len(values[id_])] for id_, value in got.items()} == values


def test_a_sample_and_what_is_beside_it_come_over_to_whom_it_is_for():
    datagram = message(US, THEM, [data(WRITER, READER, 7, PL_CDR_LE + text("a word!"), {0x83: bytes(24)})])
    got = received(datagram, THEM)
    assert got.source == US
    assert got.submessages == (Data(WRITER, READER, 7, {0x83: bytes(24)}, PL_CDR_LE + text("a word!")),)
    assert received(datagram, US).submessages == ()


@given(st.binary(max_size=120))
def test_noise_is_refused(noise):
    for datagram in (noise, message(US, THEM, [])[:20] + noise):
        with suppress(MessageError):
            received(datagram, THEM)


def test_bytes_that_are_no_message_are_refused():
    with pytest.raises(MessageError, match="no message of RTPS"):
        received(b"GIOP" + bytes(30), THEM)
