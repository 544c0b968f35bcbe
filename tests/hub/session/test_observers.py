"""Cameras in real time: they look at the newest state at their own rate, and the session never waits."""

import pytest

from hub.recording.recording import Recording
from hub.verify import verify
from schemas.codec import decode
from schemas.errors import ParticipantError
from schemas.ros import StringMessage

SCENE = """\
name: scene
step: 2 ms
duration: 1 s
pace: realtime
participants:
  jelly: {kind: "toys:Jelly"}
  camera: {kind: "toys:Camera", period: 20 ms, milliseconds: 30}
connections:
  - jelly.* -> camera.*
"""
SHOWN = """\
  - camera.seen -> pad.words
"""
TOPIC = "/engine/camera/out/seen"


def rows(words):
    """Return time (ms), number, node and triangles of each state that a camera has shown."""
    found = (word.split() for word in words)
    return [(int(t) // 1_000_000, int(a), int(b), int(c)) for t, a, b, c in found]


def recorded(directory):
    messages = Recording(directory).messages(TOPIC)
    return rows(decode(StringMessage, message.payload).data for message in messages)


def test_it_sees_the_newest_whole_states_and_misses_are_counted(prepare, tmp_path):
    """Drawing takes longer than the period, so that it must miss some."""
    session = prepare(SCENE, record=tmp_path / "recording")
    assert session.plan.order == ("jelly",)
    summary = session.run()
    assert (summary.state, summary.steps, summary.dropped_messages) == ("done", 500, 0)
    seen = recorded(tmp_path / "recording")
    assert seen[0] == (0, 0, 0, 3)  # before the session begins
    times = [time for time, *_ in seen]
    assert times == sorted(set(times))
    assert all(time % 20 == 0 and number == node == time // 2 for time, number, node, _ in seen)
    assert {triangles for *_, triangles in seen} == {3}  # they come with the state at time 0 alone
    observed = summary.observers["camera"]
    assert observed.states >= len(seen) - 2 >= 3  # its last count may come too late for the summary
    assert observed.dropped > 0
    assert observed.states + observed.dropped <= 50
    assert observed.dropped >= times[-1] // 20 - (len(seen) - 1)
    assert observed.lost is None
    assert summary.latency["state to picture"]["camera"]["count"] == observed.states


def test_the_recording_verifies_without_it(prepare, tmp_path):
    prepare(SCENE, "duration=200 ms", record=tmp_path / "recording").run()
    found = verify(Recording(tmp_path / "recording"), trust=True)
    assert (found.same, found.steps, found.hashes) == (True, 100, 100)


def test_the_session_never_waits_for_it(prepare):
    """In lock-step 25 pictures would take 25 times as long as one; here the run is over before the second."""
    summary = prepare(SCENE, "duration=500 ms", "participants.camera.milliseconds=4000").run()
    assert (summary.state, summary.steps) == ("done", 250)
    assert summary.wall_time_s < 0.5 * 25 * 4.0
    assert summary.observers["camera"].states <= summary.wall_time_s / 4.0


@pytest.mark.long
def test_a_device_is_shown_what_it_shows(prepare, tmp_path):
    file = tmp_path / "pad.txt"
    pad = f"""  pad: {{kind: "toys:Pad", host: pad, file: "{file}"}}\n"""
    scene = SCENE.replace("connections:\n", f"{pad}connections:\n") + SHOWN
    prepare(scene, "duration=1 s").run()
    seen = rows(line.partition(" ")[2] for line in file.read_text().splitlines())
    assert all(number == time // 2 for time, number, *_ in seen)
    assert len(seen) > 1


@pytest.mark.parametrize(
    ("how", "cause"),
    [("raise", "ArithmeticError: the lens is broken"), ("kill", "its process was killed by SIGKILL")],
)
def test_the_session_goes_on_without_one_that_is_lost_and_names_it(prepare, caplog, how, cause):
    summary = prepare(SCENE, f"participants.camera.dies={how}").run()
    assert (summary.state, summary.steps) == ("done", 500)
    assert summary.observers["camera"].lost == cause
    (line,) = (record.message for record in caplog.records if "lost" in record.message)
    assert line == f"observer 'camera' is lost, the session goes on without it: {cause}"


def test_a_session_does_not_begin_without_its_camera(prepare, tmp_path):
    nowhere = tmp_path / "nowhere" / "file"
    with pytest.raises(ParticipantError, match=r"'camera'.*No such file"):
        prepare(SCENE, f"participants.camera.file={nowhere}").run()


def test_two_in_one_process_take_turns(prepare, tmp_path):
    room = """  room: {kind: "toys:Camera", host: cameras, period: 50 ms, milliseconds: 10}\n"""
    scene = SCENE.replace("connections:\n", f"{room}connections:\n  - jelly.* -> room.*\n")
    summary = prepare(scene, "duration=500 ms", "participants.camera.host=cameras").run()
    assert set(summary.observers) == {"camera", "room"}
    assert all(observed.states > 0 for observed in summary.observers.values())


def test_in_pace_fast_it_is_in_lock_step(prepare, tmp_path):
    session = prepare(
        SCENE,
        "pace=fast",
        "algorithm=jacobi",  # a camera after the jelly in the order would miss its surface
        "duration=200 ms",
        "participants.camera.milliseconds=0",
        record=tmp_path / "recording",
    )
    summary = session.run()
    assert summary.observers == {}
    assert [time for time, *_ in recorded(tmp_path / "recording")] == list(range(0, 200, 20))
