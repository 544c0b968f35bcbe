"""The score of a recording is the live card, for every installed scenario with a task."""

import re

import pytest

from hub.planning.scenario_file import installed_scenarios
from hub.recording.recording import Recording
from hub.recording.scores import score_numbers
from tasks.recorded.session import score_session
from trocar import run

LONGER = {"suturing": "12 s", "peg-board-by-hand": "3 s"}
"""Until the needle is in the tissue; until a hand leads."""


WITHOUT_PICTURES = {
    name: {"participants.endoscope.images": "none"}
    for name in ("clip-and-cut-by-hand", "cholecystectomy-by-hand")
}
"""Scenes whose pictures take most of the time, and say nothing to the task."""
SERVED = {"clip-and-cut-by-policy"}
"""Scenarios that need the server of a policy: task and scene are those of clip-and-cut."""


TASK = re.compile(r"\bkind: [\w-]+-task\b")
"""A participant of a scenario file that is a task."""
QUICK = ("hand-over", "peg-board", "pick-and-place")
"""Scenarios without tissue, a kind of task each; `test_scores_of_an_operation` has the task of the operation,
with events that come later than all signals.
"""


def task_scenarios():
    """Names of the scenarios with a task, from their text: each worker collects the tests."""
    found = [name for name, file in installed_scenarios().items() if TASK.search(file.read_text())]
    return sorted(set(found) - SERVED)


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


@pytest.mark.long
@pytest.mark.parametrize("name", QUICK)
def test_the_beginning_of_a_scenario(name, tmp_path):
    compare(name, tmp_path, duration="1 s")


@pytest.mark.search
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", [name for name in task_scenarios() if name not in QUICK])
def test_the_beginning_of_any_other_scenario(name, tmp_path):
    compare(name, tmp_path, duration=LONGER.get(name, "1 s"), **WITHOUT_PICTURES.get(name, {}))


@pytest.mark.search
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", ["suturing", "hand-over", "peg-board", "pick-and-place"])
def test_a_whole_scenario(name, tmp_path):
    summary = compare(name, tmp_path)
    assert summary.measures["progress"] == 1.0
