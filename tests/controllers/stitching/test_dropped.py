"""A needle dropped in mid-stitch, in the simulation of robot and pad."""

from math import isfinite

import pytest
from ruamel.yaml import YAML

import trocar
from hub.planning.scenario_file import installed_scenarios
from schemas.codec import decode
from schemas.ros import StringMessage
from trocar import Recording


def run_with_opener(directory, arm, opener):
    """Run one stitch of `suturing` in which a jaw is opened from outside; return summary and statuses."""
    yaml = YAML(pure=True)
    scenario = yaml.load(installed_scenarios()["suturing"])
    del scenario["participants"]["endoscope"]
    scenario["connections"] = [each for each in scenario["connections"] if "endoscope" not in each]
    scenario["connections"] += ["lead.phase -> opener.phase", f"opener.jaw -> motion.{arm}/jaw/servo_jp"]
    kind = {"kind": "tests.controllers.stitching.opener:Opener", "period": "10 ms"}
    scenario["participants"]["opener"] = kind | opener
    scenario["order"] = ["lead", "opener", "motion", "robot", "eyes", "task"]
    scenario["scene"]["objects"]["needle"]["thread"] = None
    scenario["participants"]["lead"]["stitches"] = 1
    with (directory / "dropped.yaml").open("w") as file:
        yaml.dump(scenario, file)
    summary = trocar.run(directory / "dropped.yaml", record=directory / "run", one_host=True)
    recording = Recording(directory / "run")
    messages = recording.messages(recording["lead.status"].topic)
    return summary, [decode(StringMessage, each.payload).data for each in messages]


@pytest.mark.search
@pytest.mark.timeout(600)
def test_a_needle_dropped_in_the_bite_is_taken_again_and_the_stitch_is_made(tmp_path):
    summary, said = run_with_opener(tmp_path, "PSM1", {"phase": "DRIVE", "after": 1.5})
    assert summary.ending == "participant 'lead' has ended the session: all stitches are made"
    assert summary.measures["made"] == 1.0
    dropped = [each for each in said if "PSM1 has lost the needle while it was to drive: " in each]
    assert "its tip in the tissue; it is taken again" in dropped[0]


@pytest.mark.search
@pytest.mark.timeout(600)
def test_a_needle_dropped_at_every_pull_ends_the_session_with_the_reason(tmp_path):
    summary, said = run_with_opener(tmp_path, "PSM2", {"phase": "PULL", "after": 0.4})
    assert summary.ending == f"participant 'lead' has ended the session: a stitch has failed: {said[-1]}"
    assert said[-1].startswith("PSM2 has lost the needle while it was to pull: its middle is at ")
    assert said[-1].endswith("; given up after 3 recoveries")
    assert (summary.measures["made"], summary.measures["failed"]) == (0.0, 1.0)
    assert all(isfinite(value) for value in summary.measures.values())
