"""The routine with robot and tissue: the duct of a coarse scene is clipped, cut, and simulated again."""

import pytest

import trocar
from tests.controllers.cholecystectomy.world import SCENE


def told(recording, tube):
    """Return the events of a tube."""
    return [event for _, event in recording[f"tissue.{tube}/events"].messages()]


@pytest.mark.search
def test_the_duct_is_clipped_three_times_and_parted(tmp_path):
    run = tmp_path / "run"
    summary = trocar.run(SCENE, set={"duration": "28 s"}, record=run, one_host=True)
    assert summary.measures["failure"] == 0.0
    assert summary.measures["sub_task"] >= 9.0
    assert summary.measures["bile_ml"] == 0.0
    assert 0.2 < summary.measures["pull_n"] < 1.5
    events = told(trocar.Recording(run), "cystic_duct")
    assert [event.kind for event in events if event.instrument == "PSM1"] == ["clipped"] * 3
    assert "cut" in {event.kind for event in events if event.instrument == "PSM3"}
    assert not told(trocar.Recording(run), "cystic_artery")


@pytest.mark.long
def test_a_clip_that_does_not_fit_is_given_up_with_its_name_and_simulated_again_to_the_bit(tmp_path):
    run = tmp_path / "run"
    probe = {"spheres": 6, "clip": {"diameters": ["5 mm", "13 mm"]}}
    settings = {"participants.tissue.probes.PSM1": probe, "participants.routine.attempts": 1}
    summary = trocar.run(SCENE, set=settings, record=run, one_host=True)
    assert "given up in sub-task 2, clip 1 left: clip slipped" in str(summary.ending)
    assert trocar.verify(run).same
