"""Annotated data sets: COCO's masks and keypoints, BOP's models and poses, truth beside a LeRobotDataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

import trocar
from engines.mujoco.pictures import opengl
from engines.mujoco.truth.scene_class import SceneClass
from learning.datasets.coco import run_lengths
from learning.datasets.command_line import app
from tests.learning.datasets.format_rules import (
    bop_problems,
    coco_problems,
    decode_mask,
    read_json,
    read_ply,
)

pytestmark = pytest.mark.xdist_group("data sets")

SCENARIO = """
name: annotated
step: 5 ms
duration: 120 ms
participants:
  robot:
    kind: mujoco
    arms:
      PSM1:
        instrument: LARGE_NEEDLE_DRIVER_400006
        position: [181.6 mm, 0 mm, 99 mm]
        orientation: [0, 0.5, 0, 0.8660254]
        start: [0, 0, 160 mm, 0, 0, 0]
        jaw: 40 deg
      ECM:
        position: [120 mm, -110 mm, 150 mm]
        orientation: [0.1326351, -0.371565, 0.8654006, -0.3089163]
        start: [0, 0, 86 mm, 0]
    objects: {ring: {kind: ring, position: [-5 mm, 0 mm, 1 mm]}}
    table: {position: [0 mm, 0 mm, 0 mm], size: [60 mm, 60 mm, 10 mm]}
"""
SIZE, FRAMES = (160, 144), 4
TOOL = "LARGE_NEEDLE_DRIVER_400006"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    place = tmp_path_factory.mktemp("annotated")
    (place / "annotated.yaml").write_text(SCENARIO)
    trocar.run(str(place / "annotated.yaml"), record=place / "run", one_host=True)
    return place / "run"


def make(recording: Path, layout: str, *more: str) -> Path:
    target = recording.parent / layout
    words = [str(recording), "-o", str(target), "--format", layout, "--size", "160x144", *more]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return target


def test_run_lengths_are_those_of_a_mask() -> None:
    mask = np.array([[1, 0, 1], [1, 0, 0]], np.bool_)
    assert run_lengths(mask) == [0, 2, 2, 1, 1]
    assert np.array_equal(decode_mask({"size": [2, 3], "counts": run_lengths(mask)}), mask)
    assert run_lengths(np.zeros((2, 3), np.bool_)) == [6]


@pytest.fixture(scope="module")
def coco(recording: Path) -> Path:
    return make(recording, "coco")


@pytest.fixture(scope="module")
def bop(recording: Path) -> Path:
    return make(recording, "bop")


@pytest.mark.long
def test_coco_has_a_mask_and_keypoints_of_each_instance(coco: Path) -> None:
    assert list(coco_problems(coco)) == []
    content = read_json(coco / "annotations.json")
    assert len(content["images"]) == 2 * FRAMES
    names = {one["id"]: one["name"] for one in content["categories"]}
    assert {"object", TOOL} <= set(names.values())
    assert "table" not in names.values()
    (tool,) = (one for one in content["categories"] if one["name"] == TOOL)
    for picture in content["images"]:
        own = [one for one in content["annotations"] if one["image_id"] == picture["id"]]
        assert np.sum([decode_mask(one["segmentation"]) for one in own], axis=0).max() == 1
        (instrument,) = (one for one in own if one["category_id"] == tool["id"])
        points = np.array(instrument["keypoints"]).reshape(-1, 3)
        assert instrument["num_keypoints"] > 3
        left, top, width, height = instrument["bbox"]
        seen = points[points[:, 2] == 2]
        assert len(seen)
        assert (
            (seen[:, :2] > [left - 2, top - 2]) & (seen[:, :2] < [left + width + 1, top + height + 1])
        ).all()


@pytest.mark.long
def test_models_of_bop_are_where_the_poses_put_them(bop: Path) -> None:
    assert list(bop_problems(bop)) == []
    scene = bop / "train" / "000000"
    cameras, poses, seen = (read_json(scene / f"scene_{name}.json") for name in ("camera", "gt", "gt_info"))
    assert len(cameras) == FRAMES
    for pose, info in zip(poses["0"], seen["0"], strict=True):
        vertices = read_ply(bop / "models" / f"obj_{pose['obj_id']:06d}.ply")[:, :3]
        pixels, depth = projected(cameras["0"], pose, vertices)
        left, top, width, height = info["bbox_obj"]
        if (depth > 10.0).all():  # the end of the shaft is behind the camera
            low, high = pixels.min(axis=0).clip(-0.5), pixels.max(axis=0).clip(max=np.array(SIZE) - 0.5)
            assert np.abs(low - [left, top]).max() < 1.5
            assert np.abs(high - [left + width - 1, top + height - 1]).max() < 1.5


@pytest.mark.long
def test_poses_of_bop_project_to_the_keypoints_of_coco(coco: Path, bop: Path) -> None:
    infos = read_json(bop / "models" / "models_info.json")
    content = read_json(coco / "annotations.json")
    tools = {one["id"]: one["keypoints"] for one in content["categories"] if "keypoints" in one}
    compared = 0
    for one in content["annotations"]:
        frame, eye = divmod(one["image_id"], 2)
        scene = bop / "train" / f"{eye:06d}"
        camera = read_json(scene / "scene_camera.json")[str(frame)]
        points = np.array(one.get("keypoints", [])).reshape(-1, 3)
        named = dict(zip(tools.get(one["category_id"], ()), points, strict=True))
        for pose in read_json(scene / "scene_gt.json")[str(frame)]:
            joint = infos[str(pose["obj_id"])]["name"].partition("/")[2]
            if joint in named and named[joint][2] > 0:  # a joint of the wrist is the origin of its link
                pixels, _ = projected(camera, pose, np.zeros((1, 3)))
                assert np.abs(pixels[0] - named[joint][:2]).max() < 0.01
                compared += 1
    assert compared >= 2 * 2 * FRAMES


def projected(
    camera: dict[str, Any], pose: dict[str, Any], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pixels, shape (n, 2), and depths, mm, of points of a model of BOP."""
    turn = np.array(pose["cam_R_m2c"]).reshape(3, 3)
    homogeneous = (points @ turn.T + pose["cam_t_m2c"]) @ np.array(camera["cam_K"]).reshape(3, 3).T
    return homogeneous[:, :2] / homogeneous[:, 2:], homogeneous[:, 2]


def test_a_lerobot_data_set_has_its_truth_beside_it(recording: Path) -> None:
    asked = ["--truth", "depth,segmentation,flow", "--state", "robot.PSM1/measured_js.position"]
    made = make(recording, "lerobot-v3", *asked, "--action", "robot.PSM1/setpoint_js.position")
    episode = made / "truth" / "episode_000000"
    assert read_json(episode / "scene.json")["classes"]["shaft"] == SceneClass.SHAFT
    count = read_json(made / "meta/info.json")["total_frames"]
    for eye in ("left", "right"):
        places = sorted((episode / eye).iterdir())
        assert len(places) == count > 1
        with np.load(places[-1] / "truth.npz") as arrays:
            assert set(arrays) == {"depth", "flow", "scene_flow", "flow_visible"}
            assert arrays["flow"].shape == (SIZE[1], SIZE[0], 2)


def test_an_unknown_modality_is_named(recording: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, [str(recording), "-o", str(tmp_path / "new"), "--truth", "smell"])
    assert done.exit_code == 2
    assert "smell" in done.output
