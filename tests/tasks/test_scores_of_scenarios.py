"""The score of a recording is the live card, for every installed scenario with a task."""

import pytest
from ruamel.yaml import YAML

from hub.planning.scenario_file import installed_scenarios
from hub.recording.recording import Recording
from hub.recording.scores import score_numbers
from tasks.recorded.session import score_session
from trocar import run

LONGER = {"suturing": "12 s", "peg-board-by-hand": "3 s"}
"""Until the needle is in the tissue; until a hand leads."""


WITHOUT_PICTURES = {"clip-and-cut-by-hand": {"participants.endoscope.images": "none"}}
"""Scenes whose pictures take most of the time, and say nothing to the task."""
SERVED = {"clip-and-cut-by-policy"}
"""Scenarios that need the server of a policy: task and scene are those of clip-and-cut."""


def task_scenarios():
    for name, file in sorted(installed_scenarios().items()):
        participants = YAML(typ="safe", pure=True).load(file)["participants"]
        watched = any(spec["kind"].endswith("-task") for spec in participants.values())
        if watched and name not in SERVED:
            yield name


def compare(name, directory, **changes):
    """Run a scenario and compare its card with the one that its recording gives."""
    summary = run(name, set={"pace": "fast", **changes}, record=directory / "run", one_host=True)
    scored = score_session(Recording(directory / "run"), [])
    assert scored.keys() == summary.scores.keys() != set()
    for task, (card, _) in scored.items():
        found, live = score_numbers(card), summary.scores[task]
        for part in live:
            assert found[part] == live[part], f"{name}, {task}: {part}"
        assert found == live
    return summary


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", list(task_scenarios()))
def test_the_beginning_of_a_scenario(name, tmp_path):
    compare(name, tmp_path, duration=LONGER.get(name, "1 s"), **WITHOUT_PICTURES.get(name, {}))


@pytest.mark.search
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", ["suturing", "hand-over", "peg-board", "pick-and-place"])
def test_a_whole_scenario(name, tmp_path):
    summary = compare(name, tmp_path)
    assert summary.measures["progress"] == 1.0
