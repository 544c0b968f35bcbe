"""The process that draws ends in mid-session: plain looks take over, and no state changes."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.pictures import opengl, scene_apart
from engines.mujoco.pictures.filament import backend
from hub.observation.summary import Progress, Summary
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.recording.recover import recover
from hub.session.launch import launch
from schemas.codec import decode
from schemas.errors import RecordingError, SessionError
from schemas.ros import DiagnosticStatus, Image

SCENARIO = """
name: lost
step: 1 ms
duration: 400 ms
pace: fast
answer_limit: 100 s  # the first picture compiles shaders
participants:
  robot: &scene
    kind: mujoco
    arms:
      PSM1: {instrument: palpation-probe, position: [0 mm, 0 mm, 118 mm]}
    table: {position: [0 mm, 0 mm, 0 mm]}
    looks: false
  killer: {kind: "killer:Killer", period: 20 ms, at: 0.2, signal: 0, session: 0}
  camera:
    <<: *scene
    kind: endoscope
    looks: endoscope
    period: 20 ms
    width: 32
    height: 24
    view: {position: [100 mm, 0 mm, 100 mm], target: [0 mm, 0 mm, 0 mm]}
connections:
  - robot.qpos -> camera.qpos
"""
STATUS, LEFT = "/engine/camera/out/status", "/engine/camera/out/left/image_raw"


@pytest.fixture(scope="module", autouse=True)
def _killer() -> Iterator[None]:
    if not backend.find().name or not opengl.find().name or sys.platform != "linux":
        pytest.skip("no Filament, no OpenGL, or no /proc")
    here = str(Path(__file__).parent)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(here)
        patch.setenv("PYTHONPATH", here, prepend=os.pathsep)
        yield


def run(directory: Path, *changes: str, progress: Callable[[Progress], None] | None = None) -> Summary:
    file = directory / "lost.yaml"
    file.write_text(SCENARIO)
    overrides = (f"participants.killer.session={os.getpid()}", *changes)
    session = launch(load(str(file), overrides), endpoint="tcp/127.0.0.1:0", record=directory / "recording")
    return session.run(progress)


def reds(recording: Recording) -> list[float]:
    """Return the mean of each picture's red."""
    found = [decode(Image, message.payload) for message in recording.messages(LEFT)]
    return [float(np.mean(one.data[::3])) for one in found]


@pytest.mark.long
def test_plain_looks_take_over_and_every_state_stays(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    whole, lost = tmp_path / "whole", tmp_path / "lost"
    for directory in (whole, lost):
        directory.mkdir()
    expected = run(whole)
    assert expected.warnings == {}
    found = run(lost, f"participants.killer.signal={int(signal.SIGABRT)}")
    assert (found.state, found.steps, found.state_hash) == ("done", 400, expected.state_hash)
    sentence = (
        "draws plain looks from 0.200 s on: the process that drew endoscope looks was killed by SIGABRT"
    )
    assert found.warnings["camera"].startswith(sentence)
    said = [record.message for record in caplog.records if "SIGABRT" in record.message]
    assert said == [f"participant 'camera' {found.warnings['camera']}"]
    recording = Recording(lost / "recording")
    (status,) = recording.messages(STATUS)
    assert status.time_ns == 220_000_000
    assert decode(DiagnosticStatus, status.payload).message == found.warnings["camera"]
    before, after = reds(Recording(whole / "recording")), reds(recording)
    assert len(before) == len(after) == 20
    assert before[:10] == after[:10]
    assert before[10:] != after[10:]
    assert len(set(after[10:])) == 1  # nothing moves, and plain looks have no noise


@pytest.mark.long
def test_in_real_time_as_well(tmp_path: Path) -> None:
    def end_when_told(progress: Progress) -> None:
        with suppress(RecordingError):  # nothing is in the file yet
            so_far = recover(tmp_path / "recording", tmp_path / f"until-{progress.step}").path
            if any(Recording(so_far).messages(STATUS)):
                os.kill(os.getpid(), signal.SIGINT)

    changes = "pace=realtime", "duration=60 s", f"participants.killer.signal={int(signal.SIGKILL)}"
    with pytest.raises(SessionError, match="interrupted"):
        run(tmp_path, *changes, progress=end_when_told)
    (status,) = Recording(tmp_path / "recording").messages(STATUS)
    assert "was killed by SIGKILL" in decode(DiagnosticStatus, status.payload).message


def test_a_process_that_ended_while_it_waited_for_a_scene_is_closed() -> None:
    scene_apart._end_idle()
    process = scene_apart._Process()
    scene_apart._leave_idle(process)
    os.kill(process.pid, signal.SIGKILL)
    process._process.wait()
    assert scene_apart._take_idle() is None
    assert process._errors.closed
