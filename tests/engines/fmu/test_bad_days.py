"""FMUs that crash, that change when they are read, or whose description lies."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.errors import ParticipantError
from tests.engines.fmu.driving import SPRING, Make, run
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

CRASH_STEP, CHANGING_OUTPUT = 7, 8
"""Values of the parameter `fault`."""
NO_DEPENDENCIES = {'<Unknown index="9"/>': '<Unknown index="9" dependencies=""/>'}

SCENARIO = """\
name: crashing
step: 10 ms
duration: 1 s
participants:
  good: {kind: fmu, path: plant.fmu, start: {x: 1}}
  bad: {kind: fmu, path: plant.fmu, host: fmu, start: {fault: 7}}
"""


def test_one_that_crashes_in_a_host_of_its_own(libraries: dict[str, Path], tmp_path: Path) -> None:
    """The session ends, names the FMU, and its recording is whole up to there."""
    build.pack(SPRING, libraries[SPRING], tmp_path / "plant.fmu")
    path = tmp_path / "crashing.yaml"
    path.write_text(SCENARIO)
    with pytest.raises(ParticipantError, match=r"participant 'bad' failed at step 5: .* killed by SIGSEGV"):
        launch(load(str(path)), record=tmp_path / "recording").run()
    measured = Recording(tmp_path / "recording")["good.x"]
    assert len(measured.time) >= 5
    assert measured.values[0] > measured.values[4] > 0.9


def test_one_that_reading_changes(make: Make, caplog: pytest.LogCaptureFixture) -> None:
    """It is named, and goes on with the values of the first read."""
    with caplog.at_level(logging.WARNING):
        engine = make(SPRING, start={"fault": CHANGING_OUTPUT})
    assert [
        line
        for line in caplog.messages
        if "reading changes the FMU: body.a[1] differed between two reads" in line
    ]
    run(engine, 5)
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        make(SPRING)
    assert not [line for line in caplog.messages if "reading changes" in line]


def test_one_that_lies_about_its_dependencies(make: Make) -> None:
    """No result depends on declared dependencies: outputs are read after the step."""
    honest, liar = make(SPRING, start={"x": 1}), make(SPRING, edits=NO_DEPENDENCIES, start={"x": 1})
    assert run(honest, 50) == run(liar, 50)
