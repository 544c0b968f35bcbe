"""Forks: the parent's bits up to the instant, then other devices and parameters; what is refused."""

import pytest

from hub.command_line.app import app
from hub.fork import Fork
from hub.recording.family import recording_family
from hub.recording.fork_origin import fork_origin
from hub.recording.recording import Recording
from hub.verify import verify
from schemas.errors import ParticipantError, RecordingError, ScenarioError, SessionError, TrustError

SCENARIO = """
name: session
step: 1 ms
duration: 40 ms
{window}
participants:
  player: {{kind: "toys:Player", max_age_ms: 9}}
  sum: {{kind: "toys:Sum", host: {host}}}
  mixer: {{kind: "toys:Mixer"}}
  pad: {{kind: "toys:Pad", file: "{pad}"}}
connections:
  - player.hand -> sum.hand
  - sum.total -> mixer.a
  - sum.total -> pad.numbers
"""
WALL = "player={kind: 'toys:Player', clock: wall, max_age_ms: 9}"


BOTH = pytest.mark.parametrize(
    "parent", [("hub", "window: 7"), ("one", "")], ids=["one process", "two processes"], indirect=True
)


@pytest.fixture
def parent(request, prepare, tmp_path):
    host, window = getattr(request, "param", ("hub", "window: 7"))
    text = SCENARIO.format(host=host, window=window, pad=tmp_path / "pad")
    summary = prepare(text, record=tmp_path / "parent").run()
    return Recording(tmp_path / "parent"), summary.state_hash


def forked(recording, at_ms, *changes, record=None):
    return Fork(
        recording, at_ms * 1_000_000, changes, record=record, trust=True, endpoint="tcp/127.0.0.1:0"
    ).run()


def hashes(recording, name):
    return [value for ack in recording.acks(name) for value in ack.state_hash.tolist()]


def totals(recording):
    return recording["sum.total"]["data"]


def test_nothing_changed_gives_the_same_bits(parent, tmp_path):
    recording, state_hash = parent
    summary = forked(recording, 10, record=tmp_path / "fork")
    assert summary.state_hash == state_hash
    again = Recording(tmp_path / "fork")
    assert all(hashes(again, name) == hashes(recording, name) for name in ("sum", "mixer"))
    assert verify(again, trust=True).same


@BOTH
def test_parameters_change_and_the_state_stays(parent, tmp_path):
    recording, state_hash = parent
    summary = forked(recording, 10, "sum.gain=-3", "sum.offset=0.5", record=tmp_path / "fork")
    assert summary.state_hash != state_hash
    fork = Recording(tmp_path / "fork")
    before, after = totals(recording), totals(fork)
    assert (after[:11] == before[:11]).all()
    assert after[11:, 0] == pytest.approx(
        before[10, 0] - 3.0 * (before[11:, 0] - before[10, 0]) + 0.5 * (before[11:, 2] - before[10, 2])
    )
    assert hashes(fork, "sum")[:10] == hashes(recording, "sum")[:10]
    assert verify(fork, trust=True).same


def test_forks_of_forks(parent, tmp_path):
    recording, state_hash = parent
    forked(recording, 20, "sum.gain=2", record=tmp_path / "a")
    first = Recording(tmp_path / "a")
    assert forked(first, 9).state_hash == state_hash  # the change came later
    later = forked(first, 30, "sum.gain=1", record=tmp_path / "b")
    second = Recording(tmp_path / "b")
    assert verify(second, trust=True).same
    origin = fork_origin(second)
    assert origin is not None
    assert [one.step for one in origin.renewals] == [20, 30]
    assert forked(second, 35).state_hash == later.state_hash
    tree = [(one.file.parent.name, one.depth) for one in recording_family([tmp_path])]
    assert tree == [("parent", 0), ("a", 1), ("b", 2)]


@BOTH
def test_a_person_takes_over(parent, tmp_path):
    recording, _ = parent
    forked(recording, 10, WALL, "pace=realtime", "duration=100 ms", record=tmp_path / "fork")
    fork = Recording(tmp_path / "fork")
    grants = list(fork.grants())
    first = next(grant for grant in grants if grant.step == 10)
    assert [(one.port, one.stale, one.payload.size) for one in first.inlets] == [("hand", True, 0)]
    stale = totals(fork)[:, 1]
    assert stale[11] == stale[10] + 1
    assert stale[-1] < stale[10] + 80  # the device was heard
    assert hashes(fork, "sum")[:10] == hashes(recording, "sum")[:10]
    assert verify(fork, trust=True).same


def test_a_device_with_other_ports_takes_over(parent, tmp_path):
    recording, _ = parent
    connections = "[other.hand -> sum.hand, sum.total -> mixer.a, sum.total -> pad.numbers]"
    other = "participants.other={kind: 'toys:Player', max_age_ms: 9}"
    forked(recording, 10, other, f"connections={connections}", record=tmp_path / "fork")
    fork = Recording(tmp_path / "fork")
    assert hashes(fork, "sum")[:10] == hashes(recording, "sum")[:10]
    assert any(one.participant == "sum" for grant in fork.grants() for one in grant.inlets)
    assert verify(fork, trust=True).same


def test_devices_hear_nothing_of_the_past(parent, tmp_path):
    recording, _ = parent
    (tmp_path / "pad").unlink()
    forked(recording, 30)
    heard = [
        line.split("[")[1].split(",")[2].strip(" ]\n") for line in (tmp_path / "pad").read_text().splitlines()
    ]
    assert heard
    assert set(map(float, heard)) <= {0.0, *map(float, range(30, 41))}


@pytest.mark.parametrize(
    ("at_ms", "changes", "error", "message"),
    [
        (10, ["mixer.seed=5"], ParticipantError, "cannot save its state"),
        (10, ["sum.period=2 ms"], ScenarioError, "'sum' would have other period"),
        (
            10,
            ["mixer={kind: 'toys:Bare'}", "connections=[player.hand -> sum.hand]"],
            ScenarioError,
            "other kind",
        ),
        (10, ["connections=[player.hand -> sum.hand]"], ScenarioError, "'mixer' would be connected"),
        (10, ["step=0.5 ms"], ScenarioError, "keeps the communication step"),
        (10, ["sum.gian=2"], ScenarioError, r"--set sum.gian=2.*gain"),
        (40, [], ScenarioError, "ends at 0.04 s, before it is forked"),
        (50, ["duration=1 s"], RecordingError, "goes from 0 to 0.04 s"),
        (0, [], RecordingError, "cannot be forked at 0 s"),
    ],
)
def test_what_is_refused(parent, at_ms, changes, error, message):
    with pytest.raises(error, match=message):
        forked(parent[0], at_ms, *changes)


def test_a_stranger_needs_trust(parent):
    with pytest.raises(TrustError, match="toys:Sum"):
        Fork(parent[0], 10_000_000)


def test_a_past_with_other_bits_is_no_fork(parent, monkeypatch):
    import toys

    honest = toys.Mixer.step
    monkeypatch.setattr(
        toys.Mixer, "step", lambda self, t, h, inputs: honest(self, t, h + (t == 5e6), inputs)
    )
    with pytest.raises(SessionError, match=r"'mixer' has another state hash .* in step 5"):
        forked(parent[0], 10)


def test_the_command_line(parent, tmp_path):
    from typer.testing import CliRunner

    run = CliRunner().invoke
    given = [str(parent[0].file), "--at", "10 ms", "--trust", "--record", str(tmp_path / "cli")]
    assert run(app, ["fork", *given]).exit_code == 0
    assert run(app, ["fork", *given[:2], "soon"]).exit_code == 2
    shown = run(app, ["forks", str(tmp_path)]).stdout
    assert "parent" in shown
    assert "└─ cli" in shown
