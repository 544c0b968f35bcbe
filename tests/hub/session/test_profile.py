"""Where the time of a session goes, and why its steps were late."""

import json
import threading
from collections.abc import Iterable

import pytest

from hub.command_line.ls import ls
from hub.observation.late_steps import NO_CORE
from hub.recording.recording import Recording
from hub.recording.report import report
from hub.session.step_loop import StepLoop
from schemas.errors import ParticipantError
from tests.waiting import until

WORK = """\
name: work
step: 10 ms
duration: 500 ms
participants:
  heavy: {kind: "toys:Busy", burn_ms: 3}
  light: {kind: "toys:Busy", burn_ms: 1}
"""

LATE = """\
name: late
step: 5 ms
duration: 60 ms
pace: realtime
participants:
  quick: {kind: "toys:Busy"}
  slow: {kind: "toys:Busy", sleep_ms: 30}
"""


def rows_of(profile, host) -> dict:
    return profile["step"][host]


@pytest.mark.parametrize("host", ["hub", "other"])
def test_processor_time_is_the_participants_that_took_it(prepare, host):
    places = [f"participants.{name}.host={host}" for name in ("heavy", "light")]
    profile = prepare(WORK, *places, profile=True).run().profile
    heavy, light = (profile["by_taker"][f"participant {name}"] for name in ("heavy", "light"))
    assert 1.5 < heavy / light < 6.0
    assert heavy + light > 0.5 * 0.4  # of 4 ms in 10 ms
    assert profile["core_s_per_sim_s"] == pytest.approx(sum(profile["by_taker"].values()))
    assert {"participant heavy", "state hashes", "inputs", "outputs"} <= rows_of(profile, host).keys()
    for rows in profile["step"].values():
        assert sum(row["share"] for row in rows.values()) == pytest.approx(1.0)


def test_the_hub_waits_for_the_host_that_computes(prepare):
    profile = prepare(WORK, "participants.heavy.host=far", profile=True).run().profile
    assert rows_of(profile, "hub")["waiting for far"]["wall_s"] > 0.0
    assert rows_of(profile, "far")["waiting for hub"]["wall_s"] > 0.0
    assert "wire" in profile["by_taker"]


@pytest.mark.parametrize(
    ("overrides", "cause"),
    [
        ([], "participant slow"),
        (["participants.slow.host=far"], "participant slow (host far)"),
        (
            [
                "participants.slow.host=far",
                "participants.slow.sleep_ms=0",
                "participants.slow.hash_sleep_ms=30",
            ],
            "waiting for far",
        ),
    ],
    ids=["participant", "participant of another host", "host"],
)
def test_late_steps_have_their_cause(prepare, overrides: Iterable[str], cause):
    summary = prepare(LATE, *overrides, profile=True).run()
    profile = summary.profile
    # other work on the machine may take the cores from any step
    assert next(found for found in profile["late_causes"] if found != NO_CORE) == cause
    assert sum(profile["late_causes"].values()) == summary.late_steps
    assert {row["cause"] for row in profile["worst_steps"]} <= set(profile["late_causes"])
    assert all(row["took_s"] >= 0.005 for row in profile["worst_steps"])


@pytest.mark.long
def test_a_profile_changes_no_state(prepare):
    there = "participants.light.host=other"
    assert prepare(WORK, there, profile=True).run().state_hash == prepare(WORK, there).run().state_hash


def test_without_a_profile_nothing_is_timed(prepare, monkeypatch):
    shown = []
    monkeypatch.setattr(StepLoop, "show_to", shown.append)
    monkeypatch.setattr("hub.observation.stopwatch.Stopwatch.time_by_result", shown.append)
    session = prepare(WORK, "duration=20 ms")
    assert session.run().profile is None
    assert not shown
    assert all("step" not in vars(participant) for participant in session._participants.values())


def test_a_recording_has_the_profile_and_its_report_shows_it(prepare, tmp_path):
    summary = prepare(WORK, "duration=50 ms", profile=True, record=tmp_path / "with").run()
    prepare(WORK, "duration=50 ms", record=tmp_path / "without").run()
    with_, without = Recording(tmp_path / "with"), Recording(tmp_path / "without")
    profile = with_.profile()
    assert profile is not None
    assert (profile.steps, profile.sim_time_ns) == (5, 50_000_000)
    assert without.profile() is None
    assert "recorder" in summary.profile["by_taker"]
    pages = []
    for recording in (with_, without):
        report(recording, tmp_path / "page.html")
        pages.append((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert ["participant heavy" in page.partition("<pre")[0] for page in pages] == [True, False]


def test_a_host_that_fails_leaves_a_profile_in_the_recording(prepare, tmp_path):
    text = WORK + '  broken: {kind: "toys:Fault", at: 3, host: other}\n'
    with pytest.raises(ParticipantError, match="broken"):
        prepare(text, profile=True, record=tmp_path / "run").run()
    assert Recording(tmp_path / "run").profile() is not None


@pytest.mark.long
@pytest.mark.parametrize("profiled", [True, False])
def test_ls_shows_who_takes_most_of_a_running_session(prepare, capfd, profiled):
    session = prepare(
        WORK, "duration=10 min", "pace=realtime", "participants.heavy.host=far", profile=profiled
    )
    shown = []

    def look():
        def row():
            ls(connect=[session.endpoint], as_json=True)
            (row,) = json.loads(capfd.readouterr().out) or [{}]
            return row if row.get("state") == "running" and row["participants"][0]["step"] > 20 else None

        try:
            shown.append(until(row)["profile"])
            ls(connect=[session.endpoint])
            shown.append(capfd.readouterr().out)
        finally:
            session.state.shutdown()

    thread = threading.Thread(target=look)
    thread.start()
    session.run()
    thread.join()
    profile, text = shown
    if profiled:
        assert profile["by_taker"]["participant heavy"] > profile["by_taker"]["participant light"]
        assert "core-seconds" in text
    else:
        assert profile is None
        assert "core-seconds" not in text
