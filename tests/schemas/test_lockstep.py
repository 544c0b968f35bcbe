import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.lockstep import (
    Ack,
    Entering,
    Grant,
    pack_ack,
    pack_grant,
    unpack_ack,
    unpack_grant,
)
from schemas.trocar_msgs import AckMessage, GrantMessage, InletSample
from tests.strategies import finite, messages

uint64, int64 = st.integers(0, 2**64 - 1), st.integers(-(2**63), 2**63 - 1)
heads = st.tuples(uint64, st.integers(0, 2**32 - 1), int64)


@st.composite
def acks(draw: st.DrawFn, error: str = "") -> Ack:
    steps = draw(st.integers(0, 6))
    hashes, times = (draw(st.lists(uint64, min_size=steps, max_size=steps)) for _ in range(2))
    works = draw(st.lists(finite, max_size=7))
    return Ack(*draw(heads), hashes, times, works, error)


def as_message(ack: Ack) -> AckMessage:
    return AckMessage.model_validate(
        ack._asdict()
        | {
            "state_hash": np.array(ack.state_hash, np.uint64),
            "compute_ns": np.array(ack.compute_ns, np.uint64),
        }
    )


@given(acks())
def test_a_packed_ack_is_the_message(ack):
    assert pack_ack(ack) == encode(as_message(ack))


@given(acks())
def test_an_ack_comes_back_from_either_form(ack):
    for payload in (pack_ack(ack), encode(as_message(ack))):
        back = unpack_ack(payload, len(ack.state_hash), len(ack.work_j))
        assert (
            back._replace(
                state_hash=list(back.state_hash), compute_ns=list(back.compute_ns), work_j=list(back.work_j)
            )
            == ack
        )


@given(acks(), st.integers(0, 3), st.integers(0, 3))
def test_other_lengths_than_expected_are_refused(ack, steps, works):
    if (steps, works) != (len(ack.state_hash), len(ack.work_j)):
        with pytest.raises(MessageError):
            unpack_ack(pack_ack(ack), steps, works)


@given(acks(error="the rope is torn"), st.integers(0, 3), st.integers(0, 3))
def test_an_error_may_come_with_any_lengths(ack, steps, works):
    assert unpack_ack(pack_ack(ack), steps, works).error == "the rope is torn"


@given(acks(), st.data())
def test_a_damaged_report_is_refused_or_read_as_the_codec_reads_it(ack, data):
    payload = bytearray(pack_ack(ack))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    payload = bytes(payload[: data.draw(st.integers(0, len(payload)))]) + data.draw(st.binary(max_size=12))
    try:
        found = unpack_ack(payload, len(ack.state_hash), len(ack.work_j))
    except MessageError:
        return
    expected = decode(AckMessage, payload)
    assert (found.run, found.epoch, found.step, found.error) == (
        expected.run,
        expected.epoch,
        expected.step,
        expected.error,
    )
    for name in ("state_hash", "compute_ns", "work_j"):
        assert list(getattr(found, name)) == getattr(expected, name).tolist()


@pytest.mark.parametrize("work", [float("nan"), float("inf")])
def test_a_work_that_is_not_finite_is_refused(work):
    with pytest.raises(MessageError, match="finite"):
        unpack_ack(pack_ack(Ack(1, 0, 0, [1], [1], [work])), 1, 1)


samples = st.lists(messages(InletSample), max_size=2)
permissions = st.builds(
    lambda head, times, inlets: Grant(*head, *times, inlets), heads, st.tuples(int64, int64), samples
)


@given(permissions)
def test_a_packed_permission_is_a_grant(grant):
    payload = pack_grant(grant)
    assert payload == encode(GrantMessage.model_validate(grant._asdict()))
    back = unpack_grant(payload)
    assert back[:5] == grant[:5]
    assert [encode(sample) for sample in back.inlets] == [encode(sample) for sample in grant.inlets]


@given(permissions, st.data())
def test_a_damaged_permission_is_refused_or_read_as_the_codec_reads_it(grant, data):
    payload = bytearray(pack_grant(grant))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    payload = bytes(payload[: data.draw(st.integers(0, len(payload)))])
    try:
        found = unpack_grant(payload)
    except MessageError:
        return
    expected = decode(GrantMessage, payload)
    assert found[:5] == (expected.run, expected.epoch, expected.step, expected.start_ns, expected.horizon_ns)
    assert len(found.inlets) == len(expected.inlets)


def test_a_sample_that_enters_is_packed_as_its_message():
    rows = [
        ("hand", "pose", False, np.arange(9, dtype=np.uint8), 3),
        ("b", "c", True, np.zeros(0, np.uint8), 0),
    ]
    fields = InletSample.model_fields
    as_messages = [InletSample.model_validate(dict(zip(fields, row, strict=True))) for row in rows]
    entering = [Entering(*row) for row in rows]
    assert pack_grant(Grant(1, 0, 2, 3, 4, entering)) == pack_grant(Grant(1, 0, 2, 3, 4, as_messages))
