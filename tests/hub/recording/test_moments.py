"""Instants of a recording by its indexes, against a scan of the whole file."""

import numpy as np
import pytest

from hub.recording.bag import Bag
from hub.recording.moments import Moments
from hub.recording.recording import Recording
from schemas.errors import CutShortError, RecordingError
from tests.hub.sample_session import write_session


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    directory = tmp_path_factory.mktemp("moments") / "palpation"
    write_session(directory, seconds=1.0)
    return Recording(directory)


def scanned(bag: Bag, topic: str, time_ns: int):
    newest = None
    for message in bag.messages(topic):
        if message.time_ns <= time_ns and (newest is None or message.time_ns >= newest.time_ns):
            newest = message
    return newest


def test_it_finds_what_a_scan_of_the_file_finds(recorded):
    moments, draw = Moments(recorded), np.random.default_rng(4)
    start, end = moments.span_ns
    instants = [start - 1, start, end, end + 1, *draw.integers(start, end, 96).tolist()]
    all_ = {topic: list(recorded.messages(topic)) for topic in recorded.topics}
    for topic, messages in all_.items():
        for instant in instants:
            found = [m for m in messages if m.time_ns <= instant]
            expected = max(found, key=lambda m: m.time_ns) if found else None
            if expected is not None:
                expected = [m for m in found if m.time_ns == expected.time_ns][-1]
            assert moments.newest(topic, instant) == expected


def test_a_scan_is_what_the_test_above_says(recorded):
    topic = next(name for name in recorded.topics if name.endswith("/pose"))
    assert Moments(recorded).newest(topic, 400_500_000) == scanned(recorded, topic, 400_500_000)


def test_a_topic_that_is_not_there_is_named(recorded):
    with pytest.raises(RecordingError, match=r"has no topic '/hub/grants'\. Did you mean"):
        Moments(recorded).newest("/hub/grants", 0)


def test_of_a_file_that_is_being_written_it_finds_what_is_there(recorded, tmp_path):
    """At every length that the file may have for a moment: between records, and within one."""
    whole, file = recorded.file.read_bytes(), tmp_path / "growing.mcap"
    ends = [one.chunk_start_offset + one.chunk_length for one in recorded.chunks]
    lengths = sorted({*ends, *(end + 100 for end in ends), *(end - 1 for end in ends), len(whole) - 1})
    lengths.remove(ends[0] - 1)  # nothing is there yet
    file.write_bytes(whole[: lengths[0]])
    with pytest.raises(CutShortError):
        Recording(file)
    growing, all_ = Recording(file, unfinished=True), [*recorded.messages()]
    moments = Moments(growing)
    for length in lengths:
        file.write_bytes(whole[:length])
        growing.grow()
        found = [*growing.messages()]
        assert found == all_[: len(found)]
        assert sum(growing.counts.values()) == len(found)
        pose = [one for one in found if one.topic.endswith("/pose")][-1]
        assert moments.newest(pose.topic, moments.span_ns[1]) == pose
    assert (len(found), growing.counts) == (len(all_), recorded.counts)
    assert growing.attachments == recorded.attachments
    assert not growing.grow()
