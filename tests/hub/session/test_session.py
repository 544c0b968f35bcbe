"""One run, many placements: the same hashes wherever participants live and however far grants go."""

import pytest

from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify

NETWORK = """\
name: network
step: 1 ms
duration: 60 ms
participants:
  fast: {kind: "toys:Mixer", seed: 1}
  rare: {kind: "toys:Mixer", seed: 2, out_every: 3}
  two: {kind: "toys:Mixer", seed: 3, period: 2 ms, step_ns: 2000000}
  five: {kind: "toys:Mixer", seed: 4, period: 5 ms, step_ns: 5000000, out_every: 2}
  talker: {kind: "toys:Talker"}
  slow_talker: {kind: "toys:Talker", period: 5 ms}
  listener: {kind: "toys:Listener", period: 2 ms}
  other_listener: {kind: "toys:Listener"}
  ledger: {kind: "toys:Ledger", period: 2 ms}
  player: {kind: "toys:Player", silent_after_ms: 30, max_age_ms: 10}
  follower: {kind: "toys:Follower"}
  slow_follower: {kind: "toys:Follower", period: 5 ms}
order: [fast, rare, two, five]
connections:
  - fast.out -> rare.a
  - {source: fast.out, target: two.b, extrapolation: linear}
  - {source: rare.out, target: two.c, extrapolation: linear}
  - rare.out -> five.a
  - two.out -> fast.a
  - {source: five.out, target: fast.b, extrapolation: linear}
  - {source: fast.out, target: five.c, extrapolation: linear}
  - five.out -> rare.b
  - five.out -> five.b
  - talker.words -> listener.words
  - slow_talker.words -> other_listener.words
  - fast.out -> ledger.a
  - rare.out -> ledger.b
  - player.hand -> follower.hand
  - player.buttons -> follower.buttons
  - player.hand -> slow_follower.hand
  - player.buttons -> slow_follower.buttons
measure:
  heard: {kind: final, of: listener.heard}
  heard_elsewhere: {kind: final, of: other_listener.heard}
  entries: {kind: final, of: ledger.entries}
  pressed: {kind: final, of: follower.pressed}
  pressed_slowly: {kind: final, of: slow_follower.pressed}
  stale_steps: {kind: final, of: follower.stale_steps}
  mixed: {kind: mean, of: two.out}
"""

ONE, OTHER, THIRD = (
    ("rare", "two", "listener", "slow_talker", "follower"),
    ("five", "talker", "slow_follower", "ledger"),
    ("fast", "other_listener"),
)


def _on(host, names):
    return [f"participants.{name}.host={host}" for name in names]


PLACEMENTS = {
    "one host": [],
    "two hosts": _on("one", ONE),
    "three hosts": _on("one", ONE) + _on("other", OTHER),
    "none in the hub": _on("one", ONE) + _on("other", OTHER) + _on("third", THIRD),
}


@pytest.fixture(scope="module")
def reference(toys, tmp_path_factory):
    file = tmp_path_factory.mktemp("reference") / "session.yaml"
    file.write_text(NETWORK)
    return launch(load(str(file)), endpoint="tcp/127.0.0.1:0").run()


@pytest.mark.parametrize(
    ("placement", "window", "recorded"),
    [
        ("one host", 3, True),
        ("one host", 10, False),
        ("two hosts", 1, True),
        ("two hosts", 10, False),
        ("three hosts", 3, False),
        ("none in the hub", 1, False),
        ("none in the hub", 10, True),
    ],
)
def test_the_same_hashes_wherever_participants_run(prepare, reference, tmp_path, placement, window, recorded):
    session = prepare(
        NETWORK,
        f"window={window}",
        *PLACEMENTS[placement],
        record=tmp_path / "recording" if recorded else None,
    )
    summary = session.run()
    assert (summary.state, summary.steps, summary.dropped_messages) == ("done", 60, 0)
    assert summary.state_hash == reference.state_hash
    assert summary.measures == reference.measures
    assert summary.recording_complete is (True if recorded else None)


def test_every_event_arrives_and_silence_is_marked(reference):
    assert reference.measures["heard"] > 50
    assert reference.measures["heard_elsewhere"] > 10
    assert reference.measures["entries"] == 59 + 19  # of 60 and 20 values: its last step is at 58 ms
    assert reference.measures["pressed"] == 30  # one every 2 ms from 0 to 58 ms
    assert reference.measures["pressed_slowly"] == 28  # its last step is at 55 ms
    assert reference.measures["stale_steps"] == 60 - 41  # the last pose is of 30 ms, and fresh up to 40 ms


def test_a_change_of_the_connections_changes_the_hashes(prepare, reference):
    for wiring in (
        "order=[rare, fast, two, five]",
        "connections.5.extrapolation=hold",
        "connections.0.extrapolation=linear",
        "algorithm=jacobi",
    ):
        text = NETWORK.replace("- fast.out -> rare.a", "- {source: fast.out, target: rare.b}").replace(
            "five.out -> rare.b", "five.out -> rare.a"
        )
        assert prepare(text, wiring).run().state_hash != reference.state_hash


def test_a_recorded_session_is_read_back(prepare, tmp_path):
    prepare(NETWORK, "window=7", *PLACEMENTS["two hosts"], record=tmp_path / "recording").run()
    verified = verify(Recording(tmp_path / "recording"), trust=True)
    assert (verified.same, verified.steps) == (True, 60)
    assert verified.hashes == 5 * 60 + 3 * 30 + 3 * 12


SELDOM = """\
name: seldom
step: 1 ms
duration: 1250 ms
participants:
  fast: {kind: "toys:Mixer", seed: 1}
  seldom: {kind: "toys:Mixer", seed: 2, period: 600 ms, step_ns: 600000000}
  ledger: {kind: "toys:Ledger", period: 300 ms}
order: [fast, seldom, ledger]
connections:
  - fast.out -> seldom.a
  - {source: fast.out, target: seldom.b, extrapolation: linear}
  - fast.out -> ledger.a
  - seldom.out -> fast.a
"""


def test_hundreds_of_values_between_two_readings_delay_no_host(prepare):
    hashes = [prepare(SELDOM, *_on(host, ("seldom", "ledger"))).run().state_hash for host in ("hub", "far")]
    assert hashes[0] == hashes[1]


def test_a_host_without_a_step_for_a_thousand_grants_delays_none(prepare):
    rare = "participants.seldom.period=1.2 s", "participants.seldom.step_ns=1200000000"
    hashes = [prepare(SELDOM, *rare, *_on(host, ("seldom",))).run().state_hash for host in ("hub", "far")]
    assert hashes[0] == hashes[1]


UNREAD = """\
name: unread
step: 1 ms
duration: 60 ms
participants:
  two: {kind: "toys:Mixer", period: 2 ms, step_ns: 2000000, host: other}
  rare: {kind: "toys:Mixer", out_every: 3, host: other}
"""


def test_the_values_of_the_last_steps_in_other_processes_are_recorded(prepare, tmp_path):
    """The hub reads none of them, and has the acks before Zenoh has delivered the values."""
    prepare(UNREAD, record=tmp_path / "recording").run()
    recording = Recording(tmp_path / "recording")
    times = {name: recording[f"{name}.out"].time[-1] for name in ("two", "rare")}
    assert times == {"two": 0.06, "rare": 0.06}
    assert len(recording["two.out"].values) == 31
    assert len(recording["rare.out"].values) == 21
