import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.codec import decode, encode
from schemas.errors import MessageError
from schemas.lockstep import (
    Permission,
    Report,
    pack_permission,
    pack_report,
    unpack_permission,
    unpack_report,
)
from schemas.trocar_msgs import Ack, Grant, InletSample
from tests.strategies import finite, messages

uint64, int64 = st.integers(0, 2**64 - 1), st.integers(-(2**63), 2**63 - 1)
heads = st.tuples(uint64, st.integers(0, 2**32 - 1), int64)


@st.composite
def reports(draw: st.DrawFn, error: str = "") -> Report:
    steps = draw(st.integers(0, 6))
    hashes, times = (draw(st.lists(uint64, min_size=steps, max_size=steps)) for _ in range(2))
    works = draw(st.lists(finite, max_size=7))
    return Report(*draw(heads), hashes, times, works, error)


def ack(report: Report) -> Ack:
    return Ack.model_validate(
        report._asdict()
        | {
            "state_hash": np.array(report.state_hash, np.uint64),
            "compute_ns": np.array(report.compute_ns, np.uint64),
        }
    )


@given(reports())
def test_a_packed_report_is_an_ack(report):
    assert pack_report(report) == encode(ack(report))


@given(reports())
def test_a_report_comes_back_from_either_form(report):
    for payload in (pack_report(report), encode(ack(report))):
        back = unpack_report(payload, len(report.state_hash), len(report.work_j))
        assert (
            back._replace(
                state_hash=list(back.state_hash), compute_ns=list(back.compute_ns), work_j=list(back.work_j)
            )
            == report
        )


@given(reports(), st.integers(0, 3), st.integers(0, 3))
def test_other_lengths_than_expected_are_refused(report, steps, works):
    if (steps, works) != (len(report.state_hash), len(report.work_j)):
        with pytest.raises(MessageError):
            unpack_report(pack_report(report), steps, works)


@given(reports(error="the rope is torn"), st.integers(0, 3), st.integers(0, 3))
def test_an_error_may_come_with_any_lengths(report, steps, works):
    assert unpack_report(pack_report(report), steps, works).error == "the rope is torn"


@given(reports(), st.data())
def test_a_damaged_report_is_refused_or_read_as_the_codec_reads_it(report, data):
    payload = bytearray(pack_report(report))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    payload = bytes(payload[: data.draw(st.integers(0, len(payload)))]) + data.draw(st.binary(max_size=12))
    try:
        found = unpack_report(payload, len(report.state_hash), len(report.work_j))
    except MessageError:
        return
    expected = decode(Ack, payload)
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
        unpack_report(pack_report(Report(1, 0, 0, [1], [1], [work])), 1, 1)


samples = st.lists(messages(InletSample), max_size=2)
permissions = st.builds(
    lambda head, times, inlets: Permission(*head, *times, inlets), heads, st.tuples(int64, int64), samples
)


@given(permissions)
def test_a_packed_permission_is_a_grant(grant):
    payload = pack_permission(grant)
    assert payload == encode(Grant.model_validate(grant._asdict()))
    back = unpack_permission(payload)
    assert back[:5] == grant[:5]
    assert [encode(sample) for sample in back.inlets] == [encode(sample) for sample in grant.inlets]


@given(permissions, st.data())
def test_a_damaged_permission_is_refused_or_read_as_the_codec_reads_it(grant, data):
    payload = bytearray(pack_permission(grant))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    payload = bytes(payload[: data.draw(st.integers(0, len(payload)))])
    try:
        found = unpack_permission(payload)
    except MessageError:
        return
    expected = decode(Grant, payload)
    assert found[:5] == (expected.run, expected.epoch, expected.step, expected.start_ns, expected.horizon_ns)
    assert len(found.inlets) == len(expected.inlets)
