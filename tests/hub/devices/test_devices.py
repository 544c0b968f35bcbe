"""Devices of the wall clock, in the hub's process, in another one, and lost on the way."""

import subprocess
import sys
import threading

import pytest

from hub.recording.recording import Recording
from hub.remote.live_sessions import live_sessions
from hub.verify import verify
from schemas.errors import ParticipantError
from tests import waiting

SCENARIO = """\
name: hand
step: 1 ms
pace: realtime
duration: 60 s
participants:
  player: {kind: "toys:Player", clock: wall, max_age_ms: 60, period: 2 ms}
  deaf: {kind: "toys:Deaf"}
connections:
  - player.hand -> deaf.hand
  - player.buttons -> deaf.buttons
measure:
  fresh_steps: {kind: final, of: deaf.fresh_steps, live: true}
  pressed: {kind: final, of: deaf.pressed, live: true}
"""


def until(session, enough):
    """Return a progress callback that shuts `session` down after enough steps, fresh ones and presses."""

    def look(progress):
        live = (progress.live.get(name, (0.0, ""))[0] for name in ("fresh_steps", "pressed"))
        if enough(progress.step, *live):
            session.state.shutdown()

    return look


@pytest.mark.parametrize("host", ["hub", "other"])
def test_samples_enter_as_they_arrive(prepare, host):
    session = prepare(SCENARIO, f"participants.player.host={host}")
    summary = session.run(until(session, lambda steps, fresh, pressed: fresh > 100 and pressed > 50))
    assert summary.dropped_messages == 0
    assert summary.sim_time_s < 60


def test_a_device_that_falls_silent_is_marked_stale(prepare):
    session = prepare(SCENARIO, "participants.player.silent_after_ms=1000")
    summary = session.run(until(session, lambda steps, fresh, _: 0 < fresh < steps - 200))
    assert summary.sim_time_s < 60


@pytest.mark.parametrize("host", ["hub", "other"])
@pytest.mark.parametrize("when", ["open", "read"])
def test_a_device_that_fails_ends_the_run(prepare, host, when):
    with pytest.raises(ParticipantError, match=r"'player' failed.*the cable is out") as raised:
        prepare(SCENARIO, f"participants.player.host={host}", f"participants.player.fails={when}").run()
    assert raised.value.participant == "player"


@pytest.mark.long
def test_a_remote_device_may_leave_and_join_again(prepare):
    session = prepare(SCENARIO, "participants.player.host=remote")
    outcome, hosts, fresh_steps = [], [], [0.0]

    def join():
        command = [
            sys.executable,
            "-P",
            "-m",
            "hub.command_line",
            "device",
            "player",
            "--connect",
            session.endpoint,
            "--session",
            "hand",
        ]
        hosts.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))

    def wait_until(true):
        waiting.until(lambda: any(true(status) for status in live_sessions([session.endpoint])))

    def go_and_come_back():
        try:
            wait_until(lambda status: status.state == "starting")
            join()
            wait_until(lambda status: status.step > 50)
            hosts[0].kill()
            wait_until(lambda status: status.participants[0].pid == 0)
            join()
            wait_until(lambda status: status.participants[0].pid == hosts[1].pid)
            before = fresh_steps[-1]
            wait_until(lambda status: fresh_steps[-1] > before + 400)
        except TimeoutError as error:
            outcome.append(error)
        finally:
            session.state.shutdown()

    console = threading.Thread(target=go_and_come_back)
    console.start()
    summary = session.run(lambda progress: fresh_steps.append(progress.live.get("fresh_steps", (0.0, ""))[0]))
    console.join()
    with pytest.raises(subprocess.TimeoutExpired):  # it waits for the next session of this name
        hosts[1].wait(0.5)
    hosts[1].terminate()
    codes = [host.wait(waiting.LIMIT_S) for host in hosts]
    assert outcome == []
    assert codes == [-9, 0]
    assert summary.state == "done"
    assert 0 < summary.measures["fresh_steps"] < summary.steps - 60
    # measured from the first offset of the clock on, not only from the next status a second later
    assert summary.latency["device to grant"]["player.hand"]["count"] > 50


TOLD = """\
name: written
step: 1 ms
pace: realtime
participants:
  talker: {kind: "toys:Talker"}
  counter: {kind: "toys:Counter"}
  pad: {kind: "toys:Pad"}
connections:
  - talker.words -> pad.words
  - counter.number -> pad.numbers
"""


@pytest.mark.parametrize("host", ["hub", "other"])
def test_a_device_receives_every_event_and_no_value_of_a_signal_twice(prepare, tmp_path, host):
    file = tmp_path / "written.txt"
    hosts = [f"participants.{name}.host={host}" for name in ("talker", "counter")]
    session = prepare(TOLD, f"participants.pad.file={file}", *hosts)

    def lines(port):
        return [
            line.partition(" ")[2] for line in file.read_text().splitlines() if line.startswith(f"{port} ")
        ]

    def enough(progress):
        if min(len(lines("words")), len(lines("numbers"))) > 20:
            session.state.shutdown()

    summary = session.run(enough)
    assert summary.dropped_messages == 0
    words, numbers = lines("words"), lines("numbers")
    assert words == [f"word {i}" for i in range(len(words))]
    values = [float(number.strip("[]")) for number in numbers]
    assert values == sorted(set(values)), "newer ones take the place of those that wait"
    assert all(value % 2.0 == 0.0 for value in values), "of every second step"


SLOW = """\
name: slow
step: 2 ms
pace: realtime
duration: 3 s
participants:
  mixer: {kind: "toys:Mixer", step_ns: 2000000}
  console: {kind: "toys:Slow"}
connections:
  - mixer.out -> console.numbers
"""


def test_a_slow_device_receives_the_newest_values_and_misses_the_rest(prepare):
    summary = prepare(SLOW).run()
    latency = summary.latency["state to force"]["mixer.out -> console.numbers"]
    assert latency["count"] < summary.steps / 5
    # in a queue the last would have waited for nearly all of it
    assert latency["largest_s"] < 0.25 * summary.wall_time_s


@pytest.mark.parametrize("host", ["hub", "other"])
def test_device_samples_are_measured_and_recorded_with_or_without_a_connection(prepare, tmp_path, host):
    scenario = (
        SCENARIO.replace("  - player.buttons -> deaf.buttons\n", "")
        + "  x: {kind: peak-norm, of: player.hand.position}\n"
    )
    session = prepare(scenario, f"participants.player.host={host}", record=tmp_path / "recording")
    summary = session.run(until(session, lambda steps, fresh, pressed: fresh > 200))
    assert summary.dropped_messages == 0
    assert summary.measures["x"] > 0.1 / 7
    recording = Recording(tmp_path / "recording")
    counts = recording.counts
    assert counts["/device/player/out/buttons"] > 20
    assert counts["/device/player/out/hand"] > 20
    assert verify(recording, trust=True).same


def test_a_device_that_exceeds_its_rate_limit_is_limited(prepare, caplog):
    session = prepare(SCENARIO, "participants.player.rate_limit=50")
    summary = session.run(until(session, lambda steps, fresh, pressed: steps > 1500))
    assert summary.dropped_messages > 500
    assert "device 'player' sends more than 50 messages/s on port 'buttons' (rate_limit)" in caplog.text
    assert summary.measures["pressed"] < 50 * (1.0 + summary.wall_time_s) + 60
