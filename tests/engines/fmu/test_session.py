"""Sessions that an FMU ends."""

from __future__ import annotations

from pathlib import Path

import pytest

from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import TrustError
from tests.engines.fmu.driving import BALL, STAIR
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

SCENARIO = """\
name: ending
step: 100 ms
duration: 20 s
participants:
  stair: {kind: fmu, path: stair.fmu, start: {last: 4}}
  ball: {kind: fmu, path: ball.fmu, start: {ends_at: 100}}
"""


@pytest.fixture
def scenario(libraries: dict[str, Path], tmp_path: Path) -> Path:
    build.pack(STAIR, libraries[STAIR], tmp_path / "stair.fmu")
    build.pack(BALL, libraries[BALL], tmp_path / "ball.fmu")
    path = tmp_path / "ending.yaml"
    path.write_text(SCENARIO)
    return path


@pytest.mark.long
@pytest.mark.parametrize(
    ("overrides", "steps"),
    [
        ([], 30),
        (["window=4"], 32),
        (["participants.stair.host=other"], 30),
        (["participants.ball.host=other"], 30),
        (["participants.stair.host=other", "window=4"], 32),
    ],
)
def test_the_session_is_done_and_its_recording_verifies(
    scenario: Path, tmp_path: Path, overrides: list[str], steps: int
) -> None:
    """It ends with the grant, of at most `window` steps, in which the FMU asks for it."""
    recorded = tmp_path / "recording"
    summary = launch(load(str(scenario), [*overrides]), record=recorded).run()
    assert (summary.state, summary.steps, summary.recording_complete) == ("done", steps, True)
    assert summary.ending == (
        "participant 'stair' has ended the session: the FMU asks to end the simulation at 3 s"
        " (fmi2Terminated)"
    )
    again = verify(Recording(recorded), trust=True)
    assert (again.same, again.steps, again.hashes) == (True, steps, 2 * steps)


def test_at_an_event_of_fmi3(scenario: Path, tmp_path: Path) -> None:
    overrides = ["participants.ball.start.ends_at=0.2", "window=1"]
    summary = launch(load(str(scenario), overrides), record=tmp_path / "recording").run()
    assert (summary.state, summary.steps) == ("done", 5)
    assert summary.ending is not None
    assert summary.ending.startswith("participant 'ball' has ended the session: the FMU asks to end")
    assert "at 0.451523641 s (terminateSimulation of fmi3UpdateDiscreteStates)" in summary.ending
    assert verify(Recording(tmp_path / "recording"), trust=True).same


def test_a_session_that_no_participant_ends(scenario: Path) -> None:
    summary = launch(load(str(scenario), ["duration=1 s"])).run()
    assert (summary.state, summary.steps, summary.ending) == ("done", 10, None)


def test_the_command_line_shows_who_ended_it(scenario: Path) -> None:
    from typer.testing import CliRunner

    from hub.command_line.app import app

    result = CliRunner().invoke(app, ["run", str(scenario)])
    assert result.exit_code == 0, result.output
    first = result.stdout.splitlines()[0]
    assert first.startswith("ending done: participant 'stair' has ended the session")
    assert "at 3 s" in first


def test_without_trust_a_recording_runs_no_fmu(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also not one whose contents have not changed: their hash, too, is from whoever has recorded it."""
    launch(load(str(scenario), ["duration=200 ms"]), record=tmp_path / "recording").run()
    recording = Recording(tmp_path / "recording")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))  # nothing can be unpacked
    for directory in (None, tmp_path):
        with pytest.raises(TrustError) as caught:
            verify(recording, directory=directory)
        for name in ("stair", "ball"):
            assert f"native code in '{tmp_path / name}.fmu' (participant '{name}')" in str(caught.value)
