"""The past of a running session: its recording while it is written, at a server and on a page."""

import json

import pytest

from hub.recording.recording import Recording
from tests.waiting import until
from tests.webconsole.conftest import served
from tests.webconsole.test_page import answer, run
from webconsole.live import Live
from webconsole.past import Past

WRENCH = "/engine/tissue/out/probe/wrench"


@pytest.fixture
def growing(recording, tmp_path):
    """A copy of a recording that is being written, and what sets how much of it there is."""
    whole = Recording(recording)
    data, copy = whole.file.read_bytes(), tmp_path / "growing" / "growing_0.mcap"
    copy.parent.mkdir()
    ends = [one.chunk_start_offset + one.chunk_length for one in whole.chunks]
    return copy.parent, lambda chunk: copy.write_bytes(data[: ends[chunk]])


def test_it_grows_and_finds_what_the_recording_has(recording, growing):
    directory, write = growing
    past, whole = Past(directory), Recording(recording)
    past.look()
    assert past.span_ns is None, "nothing is written yet"
    ends = []
    for chunk in range(len(whole.chunks)):
        write(chunk)
        past.look()
        ends.append(past.span_ns[1])
    assert ends == sorted(ends)
    assert ends[-1] == 500_000_000
    for time_ns in (100_500_000, 400_000_000):
        expected = [one for one in whole.messages(WRENCH) if one.time_ns <= time_ns][-1]
        assert past.newest(WRENCH, time_ns) == (expected.time_ns, expected.payload)
    assert past.newest("/engine/tissue/out/nothing", 0) is None


def test_what_is_damaged_is_logged_once(growing, caplog):
    directory, write = growing
    write(0)
    past = Past(directory)
    past.look()
    span = past.span_ns
    file = directory / "growing_0.mcap"
    file.write_bytes(file.read_bytes() + bytes([6]) + (40).to_bytes(8, "little") + bytes([255]) * 40)
    past.look()
    past.look()
    assert past.span_ns == span
    assert len(caplog.records) <= 1


def test_a_session_that_is_not_recorded_has_no_past():
    async def body(socket):
        await socket.send(json.dumps({"do": "at", "time": 1.0}))
        assert "no past to show" in (await answer(socket, to="at"))["error"]
        await socket.send(json.dumps({"do": "at", "time": None}))

    live = Live(session="nothing", pid=-1)
    live.start()
    until(lambda: "nothing" in live.state["detail"])
    with served(live) as server:
        run(body, server)
