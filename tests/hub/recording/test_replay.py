import queue
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import Callback

from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.recording.replay import ReplaySummary, is_replayed, replay
from hub.transport.envelope import Tag
from hub.transport.zenoh_session import open_session
from schemas.errors import RecordingError
from tests.hub.sample_session import write_session


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    directory = tmp_path_factory.mktemp("session") / "run"
    write_session(directory, 0.2)
    return Recording(directory)


def _collect(play: Callable[[zenoh.Session], ReplaySummary]) -> tuple[ReplaySummary, list[zenoh.Sample]]:
    """Let `play` publish, and return its result with what a subscriber got."""
    with open_session("peer") as publisher:
        got: queue.Queue[zenoh.Sample] = queue.Queue()
        # called within put()
        subscriber = publisher.declare_subscriber("trocar/**", Callback(got.put, indirect=False))
        result = play(publisher)
        subscriber.undeclare()
    return result, list(got.queue)


def test_consoles_get_every_output_in_order_and_no_grant(recording: Recording) -> None:
    result, samples = _collect(lambda session: replay(recording, session, 0))
    expected = [m for m in recording.messages() if is_replayed(m.topic)]
    assert [(f"trocar/palpation{m.topic}", m.payload) for m in expected] == [
        (str(s.key_expr), s.payload.to_bytes()) for s in samples
    ]
    assert not [s for s in samples if str(s.key_expr).endswith(("/grant", "/ack"))]
    assert result.messages == len(expected) == 852
    assert result.by_topic == Counter(m.topic for m in expected)
    assert (result.session, result.interrupted) == ("palpation", False)
    tag = Tag.of(samples[-1])
    assert (tag.run, tag.time_ns) == (7, expected[-1].time_ns)


def test_the_pace_follows_the_stamps(recording: Recording) -> None:
    slow, _ = _collect(lambda session: replay(recording, session, 0.5))
    assert slow.wall_time_s >= slow.sim_time_s / 0.5
    assert slow.sim_time_s == pytest.approx(0.2)


def test_another_name(recording: Recording) -> None:
    _, samples = _collect(lambda session: replay(recording, session, 0, name="encore"))
    assert {str(s.key_expr).split("/")[1] for s in samples} == {"encore"}
    with pytest.raises(RecordingError, match="'no/name' is not a session name"):
        _collect(lambda session: replay(recording, session, 0, name="no/name"))


def test_it_can_be_stopped(recording: Recording) -> None:
    stop = threading.Event()
    threading.Timer(0.1, stop.set).start()
    begin = time.monotonic()
    result, samples = _collect(lambda session: replay(recording, session, 0.001, stop=stop))
    assert result.interrupted
    assert result.messages == len(samples) < 852
    assert time.monotonic() - begin < 100  # all of it would take 200 s


def test_ctrl_c_ends_it_with_a_count(recording: Recording) -> None:
    class Interrupted(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            raise KeyboardInterrupt

    result, samples = _collect(lambda session: replay(recording, session, 0.001, stop=Interrupted()))
    assert result.interrupted
    assert result.messages == len(samples) > 0


def test_nothing_to_replay(tmp_path: Path, recording: Recording) -> None:
    with Recorder(tmp_path / "run", attachments=recording.attachments) as recorder:
        recorder.add_channel("/hub/grant", "trocar_msgs/msg/Grant")
    with pytest.raises(RecordingError, match="holds no outputs of a session; its topics: /hub/grant"):
        _collect(lambda session: replay(Recording(tmp_path / "run"), session, 0))
