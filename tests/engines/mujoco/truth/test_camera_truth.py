"""Truth that a camera publishes while a session runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trocar
from engines.mujoco import model
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.recorded_scene import RecordedScene
from engines.mujoco.truth.camera_truth import CameraTruth
from engines.mujoco.truth.files import instruments_json
from engines.mujoco.truth.recorded_truth import RecordedTruth
from robots.dvrk.endoscope import EYES
from schemas.crtk import StringStamped
from schemas.ros import Header, Image, Time
from tests.engines.mujoco.truth.scenes import OBJECTS, start_positions

SESSION = """
name: seen
step: 5 ms
duration: 50 ms
scene:
  arms:
    PSM1: {instrument: LARGE_NEEDLE_DRIVER_400006, position: [0, 0, 0.12], start: [0, 0, 0.08, 0, 0, 0]}
  table: {position: [0, 0, -5 mm], size: [120 mm, 100 mm, 10 mm]}
participants:
  robot: {kind: mujoco}
  camera:
    kind: endoscope
    period: 20 ms
    width: 160
    height: 120
    view: {position: [0.05, -0.12, 0.09], target: [0, 0, 0]}
    truth: [keypoints]
connections:
  - robot.qpos -> camera.qpos
"""


@pytest.fixture(autouse=True)
def _gl() -> None:
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")


def test_points_that_an_instrument_comes_to_hide_are_occluded() -> None:
    params = EndoscopeParams.model_validate(OBJECTS | {"truth": ["instances", "occlusion", "keypoints"]})
    truth = CameraTruth(params, {})
    start = start_positions(params)
    insertion = model.build(params).joint("PSM1/insertion").qposadr[0]
    lower = start.copy()
    start[insertion], lower[insertion] = 0.09, 0.12
    try:
        first = dict(truth.messages(start, Header(stamp=Time.from_ns(0))))
        then = dict(truth.messages(lower, Header(stamp=Time.from_ns(40))))
    finally:
        truth.close()
    assert "left/occlusion" not in first
    hidden, before, now = then["left/occlusion"], first["left/instances"], then["left/instances"]
    assert isinstance(hidden, Image)
    assert isinstance(before, Image)
    assert isinstance(now, Image)
    assert (hidden.encoding, hidden.header.stamp.ns, now.header.stamp.ns) == ("mono8", 0, 40)
    occluded = hidden.data.reshape(120, 160) == 255
    assert set(np.unique(hidden.data)) == {0, 255}
    old, new = (one.data.view("<u2").reshape(120, 160) for one in (before, now))
    table = np.bincount(old[old > 0]).argmax()
    covered = (old == table) & (new != table)
    assert covered.sum() > 50
    assert occluded[covered].all()
    assert not occluded[(old == table) & (new == table)].any()
    tips = [_instruments(one["left/keypoints"])["PSM1"]["keypoints"]["tip"] for one in (first, then)]
    assert tips[1]["position_m"][2] != tips[0]["position_m"][2]


def _instruments(message: Any) -> dict[str, Any]:
    assert isinstance(message, StringStamped)
    return json.loads(message.string)


def test_keypoints_of_a_session_are_those_of_its_recording(tmp_path: Path) -> None:
    (tmp_path / "seen.yaml").write_text(SESSION)
    trocar.run(str(tmp_path / "seen.yaml"), record=tmp_path / "run", one_host=True)
    recording = trocar.Recording(tmp_path / "run")
    published = {eye: [m for _, m in recording[f"camera.{eye}/keypoints"].messages()] for eye in EYES}
    times = [message.header.stamp.ns for message in published["left"]]
    assert times == [0, 20_000_000, 40_000_000]
    scene = RecordedScene(recording)
    camera = scene.stereo_camera({}, (160, 120))
    with RecordedTruth(scene.states, camera, {}) as truth:
        for number, frame in enumerate(truth.frames(times, EYES)):
            for eye in EYES:
                after = instruments_json(frame[eye].instruments, keypoints=True)["PSM1"]
                live = _instruments(published[eye][number])["PSM1"]
                assert live.keys() == after.keys()
                np.testing.assert_allclose(live["camera_from_tip"], after["camera_from_tip"], atol=1e-9)
                for name, point in after["keypoints"].items():
                    assert live["keypoints"][name]["visibility"] == point["visibility"]
                    np.testing.assert_allclose(live["keypoints"][name]["pixel"], point["pixel"], atol=1e-6)
