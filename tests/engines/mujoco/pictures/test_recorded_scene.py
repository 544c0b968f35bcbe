"""Tissue of one engine in the pictures of another, and in pictures of the recording."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from typer.testing import CliRunner

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.command_line import film_app, render_app
from engines.mujoco.pictures.recorded_scene import Camera, RecordedScene, _recorded_looks
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.codec import decode
from schemas.errors import RecordingError
from schemas.ros import Image as Picture
from tests.webconsole.recorded_cut import CUT_AT, STEP_NS, write_cut

pytestmark = pytest.mark.xdist_group(
    "recorded scene"
)  # its fixtures are expensive: made once, in one process

SCENARIO = """
name: seen
step: 1 ms
duration: 200 ms
participants:
  robot: &scene
    kind: mujoco
    arms:
      PSM1: {instrument: palpation-probe, probe_radius: 5 mm, position: [0 mm, 0 mm, 118 mm]}
      ECM: {position: [45 mm, 0 mm, 200 mm], start: [0, 0, 100 mm, 0]}
    looks: false
  tissue:
    kind: bullet
    organs: {liver: &liver {size: [80 mm, 60 mm, 20 mm], young_modulus: 10 kPa, nodes: 60}}
    probes: {probe: {radius: 5 mm}}
  other:
    kind: bullet
    organs: {liver: {<<: *liver, position: [0 mm, 90 mm, 0 mm]}}
    probes: {}
  camera:
    <<: *scene
    kind: endoscope
    period: 40 ms
    width: 120
    height: 90
    baseline: 0 mm
    skins: {liver: {}, other_liver: {}}
    view: {position: [90 mm, -110 mm, 70 mm], target: [0 mm, 0 mm, -5 mm]}
connections:
  - robot.qpos -> camera.qpos
  - tissue.liver/nodes -> camera.liver/nodes
  - other.liver/nodes -> camera.other_liver/nodes
bonds:
  - {motion: robot.PSM1/probe, force: tissue.probe}
"""
LIVER_RED_TO_GREEN = 0.52 / 0.20


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Recording]:
    """The same session with the tissue in the process of all others, and in one of its own."""
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    place = tmp_path_factory.mktemp("seen")
    (place / "seen.yaml").write_text(SCENARIO)
    made: dict[str, Recording] = {}
    for host in ("hub", "tissue"):
        loaded = load(str(place / "seen.yaml"), [f"participants.tissue.host={host}"])
        launch(loaded, endpoint="tcp/127.0.0.1:0", record=place / host).run()
        made[host] = Recording(place / host)
    return made


def liver(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where the colour of the liver is: nothing else in this scene is red."""
    red, green = picture[:, :, 0].astype(float), picture[:, :, 1].astype(float)
    return (red > 15.0) & (red > 0.7 * LIVER_RED_TO_GREEN * green)


def pictures(recording: Recording) -> list[NDArray[np.uint8]]:
    found = [
        decode(Picture, message.payload)
        for message in recording.messages("/engine/camera/out/left/image_raw")
    ]
    return [image.data.reshape(image.height, image.width, 3) for image in found]


@pytest.mark.long
def test_the_camera_sees_the_tissue_wherever_that_runs(recordings: dict[str, Recording]) -> None:
    assert [ack.state_hash.tolist() for ack in recordings["hub"].acks("camera")] == [
        ack.state_hash.tolist() for ack in recordings["tissue"].acks("camera")
    ]
    one, other = pictures(recordings["hub"]), pictures(recordings["tissue"])
    assert len(one) == 5
    for left, right in zip(one, other, strict=True):
        assert np.array_equal(left, right)
        assert 0.1 < liver(left).mean() < 0.5
    assert (one[0] != one[-1]).any()  # the probe starts in the tissue and pushes it away


@pytest.mark.long
def test_a_recording_shows_what_the_camera_saw(recordings: dict[str, Recording]) -> None:
    scene = RecordedScene(recordings["tissue"])
    shown = scene.picture(160_000_000, "overview", (120, 90), (0.09, -0.11, 0.07), (0.0, 0.0, -0.005))
    there, seen = liver(shown), liver(pictures(recordings["tissue"])[-1])
    assert (there & seen).sum() > 0.95 * (there | seen).sum()


def test_an_eye_of_the_endoscope_looks_along_its_shaft(recordings: dict[str, Recording]) -> None:
    scene = RecordedScene(recordings["tissue"])
    left, right = (liver(scene.picture(160_000_000, eye, (160, 120))) for eye in ("left", "right"))
    assert left.any()
    # what is near is further right in the left eye
    assert np.flatnonzero(left.any(axis=0)).mean() > np.flatnonzero(right.any(axis=0)).mean()


def test_all_soft_bodies_of_all_engines_are_shown(recordings: dict[str, Recording]) -> None:
    aside = RecordedScene(recordings["hub"]).picture(
        0, "overview", (120, 90), (0.2, 0.045, 0.06), (0.0, 0.045, 0.0)
    )
    assert len(np.flatnonzero(np.diff(liver(aside).any(axis=0)))) == 4, (
        "one beside the other, with a gap between"
    )


def test_the_command_writes_a_picture(recordings: dict[str, Recording], tmp_path: Path) -> None:
    file = tmp_path / "moment.png"
    done = CliRunner().invoke(
        render_app,
        [
            str(recordings["tissue"].file),
            "-o",
            str(file),
            "--time",
            "0.1",
            "--width",
            "160",
            "--height",
            "120",
        ],
    )
    assert done.exit_code == 0, done.output
    assert done.stdout.strip() == str(file)
    with Image.open(file) as picture:
        assert picture.size == (160, 120)
        assert 0.05 < liver(np.asarray(picture)).mean() < 0.7


def test_a_film_has_the_scene_with_title_and_time(recordings: dict[str, Recording], tmp_path: Path) -> None:
    file = tmp_path / "moments.mp4"
    size = ["--width", "160", "--height", "120"]
    done = CliRunner().invoke(
        film_app, [str(recordings["tissue"].file), "-o", str(file), *size, "--fps", "50", "--end", "0.1"]
    )
    assert done.exit_code == 0, done.output
    assert done.stdout.strip() == str(file)
    with av.open(str(file)) as film:
        stream = film.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 160, 120)
        assert stream.average_rate == 50
        shown = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert len(shown) == 6
    for picture in shown:
        assert liver(picture).mean() > 0.03
        for corner in (picture[-14:, :40], picture[-14:, -40:]):
            assert corner.max() > 200, "white letters"


@pytest.mark.parametrize("camera", ["overview", "left"])
def test_pictures_of_a_film_are_those_of_single_moments(
    recordings: dict[str, Recording], camera: Camera
) -> None:
    scene = RecordedScene(recordings["tissue"])
    times = [0, 40_000_000, 160_000_000]
    for time, picture in zip(times, scene.pictures(times, camera, (80, 60)), strict=True):
        assert np.array_equal(picture, scene.picture(time, camera, (80, 60)))


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["-o", "film.avi"], ".mp4"),
        (["-o", "film.mp4", "--width", "161"], "even width"),
        (["-o", "film.mp4", "--start", "100"], "the recording has 0.2 s"),
    ],
)
def test_bad_usage_of_film_is_refused(
    recordings: dict[str, Recording], arguments: list[str], problem: str
) -> None:
    done = CliRunner().invoke(film_app, [str(recordings["tissue"].file), *arguments])
    assert done.exit_code == 2
    assert problem in " ".join(done.output.replace("│", " ").split())


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["-o", "moment.bmp"], ".png or .jpg"),
        (["-o", "moment.png", "--from", "1,2"], "write x,y,z"),
        (["-o", "moment.png", "--width", "5000"], "4096"),
    ],
)
def test_bad_usage_is_refused(recordings: dict[str, Recording], arguments: list[str], problem: str) -> None:
    done = CliRunner().invoke(render_app, [str(recordings["tissue"].file), *arguments])
    assert done.exit_code == 2
    assert problem in done.output


def test_a_picture_may_be_larger_than_that_of_a_message(recordings: dict[str, Recording]) -> None:
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    picture = RecordedScene(recordings["tissue"]).picture(0, camera="left", size=(4096, 16))
    assert picture.shape == (16, 4096, 3)


@pytest.mark.long
def test_soft_bodies_lie_on_a_floor_with_squares(recordings: dict[str, Recording]) -> None:
    scene = RecordedScene(recordings["hub"], looks="plain")
    picture = scene.picture(
        0, camera="overview", size=(160, 120), position=(0.3, 0.0, 0.2), target=(0.3, 0, 0)
    )
    tones = np.unique(picture[::20, ::20].reshape(-1, 3).astype(int).sum(axis=1))
    assert np.ptp(tones) > 20


@pytest.mark.long
def test_a_scene_of_an_arm_alone_is_seen_at_its_tip(tmp_path: Path) -> None:
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    arm = "step: 1 ms\nduration: 3 ms\nparticipants:\n  robot: {kind: mujoco, arms: {PSM1: {}}}\n"
    (tmp_path / "arm.yaml").write_text(f"name: arm\n{arm}")
    launch(load(str(tmp_path / "arm.yaml")), endpoint="tcp/127.0.0.1:0", record=tmp_path / "run").run()
    picture = (
        RecordedScene(Recording(tmp_path / "run"))
        .picture(0, camera="overview", size=(160, 120))
        .astype(float)
    )
    background, middle = picture[0, 0], picture[40:80, 60:100].reshape(-1, 3)
    assert np.abs(middle - background).sum(axis=1).max() > 60.0


def test_a_recording_without_a_scene_is_refused(recordings: dict[str, Recording]) -> None:
    with pytest.raises(RecordingError, match="no scene of 'robo'; participants of kind mujoco: robot"):
        RecordedScene(recordings["hub"], "robo")


def test_a_scene_on_the_cart_is_drawn_as_it_was_stated(tmp_path: Path) -> None:
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    file = tmp_path / "cart.yaml"
    file.write_text(
        "name: cart\nstep: 5 ms\nduration: 10 ms\nparticipants: {robot: {kind: mujoco, mounting: cart, looks:"
        " false, arms: {PSM1: {instrument: palpation-probe}, ECM: {endoscope: up}}}}\n"
    )
    launch(load(str(file)), endpoint="tcp/127.0.0.1:0", record=tmp_path / "bag").run()
    picture = RecordedScene(Recording(tmp_path / "bag")).picture(0, camera="left", size=(40, 30))
    assert picture.shape == (30, 40, 3)


def test_a_cut_is_drawn_from_its_instant_on(tmp_path: Path) -> None:
    if not opengl.find().name:
        pytest.skip("no OpenGL")
    write_cut(tmp_path / "cut")
    scene = RecordedScene(Recording(tmp_path / "cut"))
    view = {"position": (0.0, -0.01, 0.12), "target": (0.0, 0.0, 0.0)}
    times = [0, (CUT_AT - 1) * STEP_NS, 2 * CUT_AT * STEP_NS]
    whole, before, after = scene.pictures(times, "overview", (160, 120), **view)
    assert np.array_equal(whole, before)
    alone = scene.picture(times[-1], "overview", (160, 120), **view)
    assert np.array_equal(alone, after)
    assert (after.astype(int) - before.astype(int) != 0).any(axis=2).mean() > 0.01


def test_render_writes_the_truth_beside_a_picture(recordings: dict[str, Recording], tmp_path: Path) -> None:
    target = tmp_path / "truth"
    chosen = ["--modalities", "depth,segmentation,normals,flow,keypoints", "--time", "0.1"]
    size = ["--width", "120", "--height", "90"]
    done = CliRunner().invoke(render_app, [str(recordings["hub"].file), *chosen, *size, "-o", str(target)])
    assert done.exit_code == 0, done.output
    content = json.loads((target / "truth.json").read_text())
    liver = [body["id"] for body in content["bodies"] if body["class"] == "liver"]
    assert len(liver) == 2  # of both engines
    bodies, classes = (np.asarray(Image.open(target / f"{name}.png")) for name in ("bodies", "segmentation"))
    assert bodies.dtype == classes.dtype == np.uint16
    assert np.array_equal(np.isin(bodies, liver), classes == content["classes"]["liver"])
    picture = np.asarray(Image.open(target / "picture.png")).astype(float)
    red = picture[..., 0] > 1.5 * picture[..., 1] + 10.0
    assert (red == (classes == content["classes"]["liver"])).mean() > 0.98
    with np.load(target / "truth.npz") as arrays:
        assert set(arrays) == {"depth", "normals", "flow", "scene_flow", "flow_visible"}
        coarse = np.asarray(Image.open(target / "depth.png")) * 1e-4
        assert np.abs(coarse - arrays["depth"]).max() < 0.51e-4
        assert np.isfinite(arrays["flow"]).all(axis=2).sum() == (arrays["depth"] > 0.0).sum()
    (arm,) = content["instruments"]
    assert content["instruments"][arm]["keypoints"]["tip"]["visibility"] in (0, 1, 2)


def test_render_names_the_modalities_that_there_are(recordings: dict[str, Recording]) -> None:
    done = CliRunner().invoke(render_app, [str(recordings["hub"].file), "--modalities", "depth,heat"])
    assert done.exit_code == 2
    assert "heat" in done.output
    assert "segmentation" in done.output


def test_a_recording_is_drawn_with_the_looks_of_its_camera_unless_told_otherwise(
    recordings: dict[str, Recording],
) -> None:
    recording = recordings["hub"]
    assert RecordedScene(recording, looks=None)._looks == "plain"
    camera = recording.scenario().participants["camera"]
    with_looks = camera.model_copy(update={"looks": "endoscope"})
    assert _recorded_looks({"robot": camera, "camera": with_looks}) == "endoscope"
