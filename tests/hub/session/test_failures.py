"""Failures: the participant and its step are named, the recording is readable, and nothing is left behind."""

import os
import signal
from pathlib import Path
from time import monotonic_ns

import pytest

from hub.hosting.interrupt import Interrupt
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session import session as session_module
from hub.session.run import Run
from schemas.errors import ParticipantError, ScenarioError, SessionError
from tests.hub.processes import processes

TRIO = """\
name: trio
step: 1 ms
duration: 40 ms
participants:
  source: {kind: "toys:Mixer"}
  bad: {kind: "toys:Fault"}
  sink: {kind: "toys:Mixer"}
connections:
  - source.out -> bad.a
  - bad.out -> sink.a
"""
BAD_AWAY, ALL_AWAY = (
    ["participants.bad.host=other"],
    [f"participants.{name}.host=other" for name in ("source", "bad", "sink")],
)
THREE_HOSTS = ["participants.source.host=one", "participants.bad.host=two", "participants.sink.host=three"]
PLACEMENTS = {"hub": [], "process": BAD_AWAY, "one process": ALL_AWAY, "three processes": THREE_HOSTS}
CAUSES = {
    "raise": "ArithmeticError: the rope is torn",
    "nan": "port 'out': not all of",
    "shape": "port 'out': float64 of shape (2,)",
}


def _segments():
    """Return the shared memory that Zenoh has left on this machine; other programs come and go."""
    return set(Path("/dev/shm").glob("*.zenoh"))


@pytest.fixture
def fail(prepare, tmp_path, caplog):
    """Run a session that must fail, recorded; return the error after a look at what is left."""

    def fail(text, *overrides, error=ParticipantError):
        segments = _segments()
        session = prepare(text, *overrides, record=tmp_path / "recording")
        with pytest.raises(error) as raised:
            session.run()
        assert processes(session.endpoint) == []
        assert _segments() <= segments
        recording = Recording(tmp_path / "recording")
        assert recording.scenario().name == session.scenario.name
        last = [status for _, status in recording.statuses()][-1]
        assert last.state == "failed"
        if isinstance(raised.value, SessionError):
            assert last.detail == str(raised.value)
            assert f"ending the session: {raised.value}" in caplog.text
        raised.value.grants = len(list(recording.grants()))
        return raised.value

    return fail


@pytest.mark.parametrize(
    ("how", "placement"),
    [
        *(("raise", placement) for placement in PLACEMENTS),
        ("nan", "hub"),
        ("nan", "process"),
        ("shape", "hub"),
        ("shape", "one process"),
    ],
)
def test_a_participant_that_fails_is_named_with_step_and_cause(fail, how, placement):
    error = fail(
        TRIO, f"participants.bad.how={how}", "participants.bad.at=7", "window=3", *PLACEMENTS[placement]
    )
    assert (error.participant, error.step) == ("bad", 7)
    assert CAUSES[how] in str(error)


@pytest.mark.parametrize("place", ["ending", "telling"])
def test_a_second_failure_does_not_replace_the_first(prepare, monkeypatch, place):
    """A process that has reported its error ends, which the watchdog notices at some moment."""
    session = prepare(TRIO, "participants.bad.how=raise")
    runs = []
    monkeypatch.setattr(session_module, "Run", lambda *args: runs.append(Run(*args)) or runs[0])
    owner, name = (Interrupt, "disarm") if place == "ending" else (session_module.log, "error")
    go_on = getattr(owner, name)

    def fail_again(*arguments):
        runs[0].failure.report("sink", "its process is gone")
        go_on(*arguments)

    monkeypatch.setattr(owner, name, fail_again)
    with pytest.raises(ParticipantError, match="'bad' failed at step 5: ArithmeticError: the rope is torn"):
        session.run()


@pytest.mark.parametrize("placement", ["hub", "process"])
def test_a_participant_that_cannot_be_configured(fail, placement):
    error = fail(TRIO, "participants.bad.how=configure", *PLACEMENTS[placement])
    assert error.participant == "bad"
    assert "the robot is not plugged in" in str(error)


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_a_participant_that_hangs(fail, placement):
    error = fail(
        TRIO, "participants.bad.how=hang", "participants.bad.at=7", "answer_limit=2 s", *PLACEMENTS[placement]
    )
    assert (error.participant, error.step) == ("bad", 7)
    assert "not answered for 2 s (answer_limit)" in str(error)


@pytest.mark.parametrize(
    ("placement", "step"), [("process", 18), ("one process", 20), ("three processes", 0)]
)
def test_a_killed_process(fail, tmp_path, placement, step):
    error = fail(
        TRIO,
        "participants.bad.how=kill",
        f"participants.bad.at={step}",
        f"participants.bad.stamp={tmp_path / 'killed'}",
        *PLACEMENTS[placement],
    )
    reported_ms = (monotonic_ns() - int((tmp_path / "killed").read_text())) / 1e6
    assert error.step == step
    assert "killed by SIGKILL" in str(error)
    assert error.participant == "bad"
    assert error.grants == step + 1
    assert reported_ms < 5000


def test_a_process_that_ends_by_itself(fail):
    error = fail(TRIO, "participants.bad.how=exit", *BAD_AWAY)
    assert (error.participant, error.step) == ("bad", 5)
    assert "exit code 7" in str(error)


def test_a_second_sigterm_does_not_cut_the_recording_short(prepare, monkeypatch, tmp_path):
    ended, close = [], Recorder.close

    def close_and_terminate(recorder):
        os.kill(os.getpid(), signal.SIGTERM)
        return close(recorder)

    monkeypatch.setattr(Recorder, "close", close_and_terminate)
    before = signal.signal(signal.SIGTERM, lambda *_: ended.append("here the process would end"))
    try:
        session = prepare(TRIO, "participants.bad.at=1000", record=tmp_path / "recording")
        assert session.run().recording_complete
    finally:
        signal.signal(signal.SIGTERM, before)
    assert ended == []


def test_a_remote_participant_that_does_not_join(fail):
    error = fail(TRIO, "participants.bad.host=remote", "join_limit=300 ms", error=SessionError)
    assert "remote/bad ('bad') did not join within 0.3 s (join_limit) at tcp/127.0.0.1" in str(error)


BOND = """\
name: bond
step: 1 ms
duration: 20 ms
participants:
  mass: {kind: "toys:Mass"}
  spring: {kind: "toys:Spring"}
bonds:
  - {motion: mass.tip, force: spring.tip}
"""


@pytest.mark.parametrize("host", ["hub", "other"])
def test_work_that_is_not_finite(fail, host):
    error = fail(BOND, "participants.mass.nan_at=4", f"participants.mass.host={host}")
    assert (error.participant, error.step) == ("mass", 4)
    assert "tip/work" in str(error)


def test_a_step_that_breaks_the_stable_step_rule_is_refused(fail):
    error = fail(BOND.replace("mass: {", "mass: {mass: 0.001, "), error=ScenarioError)
    assert "H <= 0.5 m/b" in str(error)
    assert error.path == ("bonds", 0)
