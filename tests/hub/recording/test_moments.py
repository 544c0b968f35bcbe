"""Instants of a recording by its indexes, against a scan of the whole file."""

import numpy as np
import pytest

from hub.recording.bag import Bag
from hub.recording.moments import Moments
from hub.recording.recording import Recording
from schemas.errors import RecordingError
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
