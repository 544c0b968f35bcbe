"""Annotated data sets: COCO's masks and keypoints, BOP's models and poses, truth beside a LeRobotDataset."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from typer.testing import CliRunner

import trocar
from engines.mujoco.pictures import opengl
from engines.mujoco.truth.scene_class import SceneClass
from learning.datasets.coco import run_lengths
from learning.datasets.command_line import app

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


def read_json(file: Path) -> Any:
    return json.loads(file.read_text())


def mask_of(segmentation: dict[str, Any]) -> NDArray[np.bool_]:
    height, width = segmentation["size"]
    values = np.arange(len(segmentation["counts"])) % 2 == 1
    return values.repeat(segmentation["counts"]).reshape(width, height).T


def test_run_lengths_are_those_of_a_mask() -> None:
    mask = np.array([[1, 0, 1], [1, 0, 0]], np.bool_)
    assert run_lengths(mask) == [0, 2, 2, 1, 1]
    assert np.array_equal(mask_of({"size": [2, 3], "counts": run_lengths(mask)}), mask)
    assert run_lengths(np.zeros((2, 3), np.bool_)) == [6]


@pytest.mark.long
def test_coco_has_a_mask_and_keypoints_of_each_instance(recording: Path) -> None:
    made = make(recording, "coco")
    content = read_json(made / "annotations.json")
    assert len(content["images"]) == 2 * FRAMES
    names = {one["id"]: one["name"] for one in content["categories"]}
    assert {"object", TOOL} <= set(names.values())
    assert "table" not in names.values()
    (tool,) = (one for one in content["categories"] if one["name"] == TOOL)
    for picture in content["images"]:
        with Image.open(made / picture["file_name"]) as file:
            assert file.size == SIZE
        own = [one for one in content["annotations"] if one["image_id"] == picture["id"]]
        masks = [mask_of(one["segmentation"]) for one in own]
        assert np.sum(masks, axis=0).max() == 1  # a pixel shows one instance
        for one, mask in zip(own, masks, strict=True):
            left, top, width, height = one["bbox"]
            assert one["area"] == mask.sum() == mask[top : top + height, left : left + width].sum()
        (instrument,) = (one for one in own if one["category_id"] == tool["id"])
        points = np.array(instrument["keypoints"]).reshape(-1, 3)
        assert len(points) == len(tool["keypoints"])
        assert instrument["num_keypoints"] == (points[:, 2] > 0).sum() > 3
        left, top, width, height = instrument["bbox"]
        seen = points[points[:, 2] == 2]
        assert len(seen)
        assert (
            (seen[:, :2] > [left - 2, top - 2]) & (seen[:, :2] < [left + width + 1, top + height + 1])
        ).all()


@pytest.mark.long
def test_models_of_bop_are_where_the_poses_put_them(recording: Path) -> None:
    made = make(recording, "bop")
    scene = made / "train" / "000000"
    infos = read_json(made / "models" / "models_info.json")
    cameras, poses, seen = (read_json(scene / f"scene_{name}.json") for name in ("camera", "gt", "gt_info"))
    assert len(cameras) == len(poses) == len(seen) == FRAMES
    assert len(list((scene / "rgb").iterdir())) == len(list((scene / "depth").iterdir())) == FRAMES
    for number, (pose, info) in enumerate(zip(poses["0"], seen["0"], strict=True)):
        lines = (made / "models" / f"obj_{pose['obj_id']:06d}.ply").read_text().splitlines()
        count = int(next(line for line in lines if line.startswith("element vertex")).split()[-1])
        start = lines.index("end_header") + 1
        vertices = np.array([line.split() for line in lines[start : start + count]], float)
        assert np.allclose(np.ptp(vertices, axis=0)[0], infos[str(pose["obj_id"])]["size_x"], atol=1e-4)
        turn = np.array(pose["cam_R_m2c"]).reshape(3, 3)
        homogeneous = (vertices @ turn.T + pose["cam_t_m2c"]) @ np.array(cameras["0"]["cam_K"]).reshape(
            3, 3
        ).T
        pixels = homogeneous[:, :2] / homogeneous[:, 2:]
        mask = np.asarray(Image.open(scene / "mask" / f"000000_{number:06d}.png")) > 0
        visible = np.asarray(Image.open(scene / "mask_visib" / f"000000_{number:06d}.png")) > 0
        assert not (visible & ~mask).any()
        assert info["px_count_visib"] == visible.sum()
        left, top, width, height = info["bbox_obj"]
        if (homogeneous[:, 2] > 10.0).all():  # the end of the shaft is behind the camera
            low, high = pixels.min(axis=0).clip(-0.5), pixels.max(axis=0).clip(max=np.array(SIZE) - 0.5)
            assert np.abs(low - [left, top]).max() < 1.5
            assert np.abs(high - [left + width - 1, top + height - 1]).max() < 1.5


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
