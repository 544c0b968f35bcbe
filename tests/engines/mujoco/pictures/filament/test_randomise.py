"""Random differences of what is seen: from a seed, and drawn again from a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.pictures.filament import backend
from engines.mujoco.pictures.recorded_scene import RecordedScene
from engines.mujoco.pictures.variation import RandomiseParams, Variation
from engines.mujoco.textures.noise import SEED
from engines.mujoco.textures.tissues import TISSUES
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.codec import decode
from schemas.ros import Image

SIZE = 80, 60
SCENARIO = """
name: varied
step: 1 ms
duration: 121 ms
pace: fast
answer_limit: 100 s  # the first picture compiles shaders
participants:
  robot: &scene
    kind: mujoco
    arms:
      PSM1: {instrument: palpation-probe, position: [0 mm, 0 mm, 118 mm]}
      ECM: {position: [45 mm, 0 mm, 200 mm], start: [0, 0, 100 mm, 0]}
    looks: false
  tissue:
    kind: bullet
    organs: {liver: {size: [80 mm, 60 mm, 20 mm], young_modulus: 10 kPa, nodes: 60}}
    probes: {}
  camera:
    <<: *scene
    kind: endoscope
    looks: endoscope
    period: 40 ms
    width: 80
    height: 60
    skins: {liver: {}}
    randomise: {seed: 7}
order: [tissue, robot, camera]
connections:
  - robot.qpos -> camera.qpos
  - tissue.liver/nodes -> camera.liver/nodes
"""


def test_parts_vary_within_their_limits_and_do_not_depend_on_one_another() -> None:
    found = [Variation(RandomiseParams(seed=seed)) for seed in range(40)]
    stops = np.array([one.exposure for one in found])
    assert np.abs(stops).max() <= 0.5
    assert stops.std() > 0.2
    places = np.array([one.mounting[:3, 3] for one in found])
    assert 1e-3 < np.abs(places).max() <= 2e-3
    assert len({one.texture_seed for one in found} | {one.place_seed for one in found}) == 80
    still = Variation(RandomiseParams(seed=3, textures=False, offset=0.0, turn=0.0))
    assert still.texture_seed == SEED
    assert np.array_equal(still.mounting, np.eye(4))
    assert still.exposure == found[3].exposure
    assert still.smoke == found[3].smoke


def test_without_parameters_nothing_varies() -> None:
    none = Variation(None)
    assert none.recolour(TISSUES["liver"], "liver") is TISSUES["liver"]
    assert (none.texture_seed, none.place_seed, none.exposure, none.smoke) == (SEED, 0, 0.0, 0.0)
    assert np.array_equal(none.lamp_colour, np.ones(3))


@pytest.mark.long
def test_pictures_are_drawn_again_from_the_recording(tmp_path: Path) -> None:
    if not (found := backend.find()).name:
        pytest.skip(f"no Filament: {found.detail}")
    (tmp_path / "varied.yaml").write_text(SCENARIO)
    launch(
        load(str(tmp_path / "varied.yaml"), []), endpoint="tcp/127.0.0.1:0", record=tmp_path / "record"
    ).run()
    recording = Recording(tmp_path / "record")
    taken = [
        decode(Image, message.payload)
        for message in recording.messages(recording["camera.left/image_raw"].topic)
    ]
    times = [picture.header.stamp.ns for picture in taken]
    assert len(taken) >= 3
    again = list(RecordedScene(recording, looks="endoscope").stereo(times, SIZE))
    for picture, (left, _) in zip(taken, again, strict=True):
        assert np.array_equal(picture.data.reshape(SIZE[1], SIZE[0], 3), left)
    ((other, _),) = RecordedScene(recording, looks="endoscope", randomise=8).stereo(times[:1], SIZE)
    assert np.abs(other.astype(int) - again[0][0]).mean() > 5.0
