"""What controllers and gateways call a repetition, and what stands in their records of it."""

from zlib import crc32

import numpy as np
import pytest

from robots.dvrk.repeats import RememberedCommands, is_recent, refusals_to_report

S = 1_000_000_000


def test_a_command_is_new_once():
    commands = RememberedCommands()
    assert not commands.is_repeated(1_700_000_000, 123_456_789, "home")
    assert commands.is_repeated(1_700_000_000, 123_456_789, "home")
    assert not commands.is_repeated(1_700_000_000, 123_456_789, "enable")
    assert not commands.is_repeated(1_700_000_000, 123_456_790, "home")


def test_a_command_without_a_stamp_is_always_new():
    commands = RememberedCommands()
    assert not any(commands.is_repeated(0, 0, text) for text in ("home", "home", "", ""))
    assert not commands.state.any()


def test_the_last_eight_commands_are_remembered():
    commands = RememberedCommands()
    assert not any(commands.is_repeated(0, stamp) for stamp in range(1, 10))
    assert [commands.is_repeated(0, stamp) for stamp in range(9, 0, -1)] == [True] * 8 + [False]


def test_the_record_of_commands_has_stamps_and_checksums_the_newest_first():
    commands = RememberedCommands()
    commands.is_repeated(5, 6, "home")
    commands.is_repeated(7, 8, "unhome")
    assert commands.state.shape == (8, 3)
    assert commands.state.dtype == np.float64
    assert commands.state[:2].tolist() == [[7, 8, crc32(b"unhome")], [5, 6, crc32(b"home")]]
    assert not commands.state[2:].any()


def test_the_same_refusal_is_reported_once_in_two_seconds_with_its_count():
    last = np.zeros(3)
    counts = [refusals_to_report(last, "too far", 10 * S + t * S // 4) for t in range(17)]
    assert counts == [1] + [0] * 7 + [8] + [0] * 7 + [8]


def test_another_refusal_is_reported_at_once():
    last = np.zeros(3)
    words = ["too far", "too far", "not homed", "too far"]
    assert [refusals_to_report(last, text, 10 * S) for text in words] == [1, 0, 1, 1]


def test_the_record_of_a_refusal_has_its_checksum_its_time_and_its_count():
    last = np.zeros(3)
    for t in (10 * S, 11 * S, 11 * S + 1):
        refusals_to_report(last, "too far", t)
    assert last.tolist() == [crc32(b"too far"), 10.0, 2.0]


@pytest.mark.parametrize(("now_ns", "recent"), [(11 * S, True), (12 * S - 1, True), (12 * S, False)])
def test_a_refusal_is_recent_for_two_seconds(now_ns: int, recent: bool):
    assert is_recent(np.array([1.0, 10.0, 0.0]), now_ns) is recent
