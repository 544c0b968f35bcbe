"""An operation in a session: the live card, that of its recording, its events, and the same state again."""

from pathlib import Path

import pytest

from hub.recording.recording import Recording
from tests.tasks.test_scores_of_scenarios import compare
from trocar import verify


@pytest.mark.long
def test_a_session_its_recording_and_its_re_simulation_agree(tmp_path):
    summary = compare(str(Path(__file__).parent / "operation.yaml"), tmp_path)
    metrics = summary.scores["task"]["metrics"]
    assert metrics["errors/energy_in_the_air"]["value"] == metrics["errors/clip_slipped"]["value"] == 1.0
    assert metrics["PSM2/idle_energy"]["value"] > 5.0
    assert "connect or record" in metrics["artery/clips"]["reason"]
    assert summary.measures["errors"] == 2.0
    events = [event.event for _, event in Recording(tmp_path / "run")["task.events"].messages()]
    assert events == ["phase", "energy in the air", "clip slipped"]
    assert verify(tmp_path / "run").same
