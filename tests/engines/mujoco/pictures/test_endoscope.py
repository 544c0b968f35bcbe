from __future__ import annotations

import logging
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Picture

from engines.mujoco.model import build
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope import Endoscope
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.ports import position_count
from engines.mujoco.truth.scene_class import SceneClass
from hub.participant import Inputs, Outputs, Setup
from hub.testing import check_engine
from robots.dvrk.endoscope import EYES, optical_in_roll
from schemas.errors import StateError
from schemas.ros import CameraInfo, CompressedImage, Image, Time
from schemas.vectors import Vector

PERIOD_NS = 16_000_000
ECM_START = [0.3, -0.2, 0.1, 0.4]
AHEAD = 0.08
"""Distance of the points, m."""
SPREAD = [(0.0, 0.0), (-0.03, 0.02), (0.03, 0.01), (-0.02, -0.02), (0.025, -0.015)]
"""Where they lie in the optical frame, right and down, m."""
NOTHING = opengl.OpenGL("", "egl: no driver; osmesa: no library")


@pytest.fixture
def gl() -> str:
    """The OpenGL of this machine; `.ci/run` installs one."""
    found = opengl.find()
    if not found.name:
        pytest.skip(f"no OpenGL: {found.detail}")
    return found.name


def camera_pose(endoscope: str = "straight") -> Vector:
    """The optical frame of a free ECM, from kinematics alone."""
    scene = EndoscopeParams.model_validate({"arms": {"ECM": {"start": ECM_START}}})
    return scene.arms["ECM"].chain.forward(np.array(ECM_START)) @ optical_in_roll(endoscope)  # type: ignore[arg-type]


def make(points: NDArray[np.float64] | None = None, **params: Any) -> Endoscope:
    """An endoscope that sees a small bright cube at each of `points`, shape (n, 3), in the world."""
    given = (
        {}
        if points is None
        else {
            f"cube{i}": {"kind": "block", "size": ["1.5 mm"] * 3, "position": point.tolist()}
            for i, point in enumerate(points)
        }
    )
    scene = {
        "arms": {"ECM": {"start": ECM_START, "endoscope": params.pop("endoscope", "straight")}},
        "objects": given,
        "looks": False,
    }
    return Endoscope("endoscope", EndoscopeParams.model_validate(scene | params))


def state(endoscope: Endoscope) -> Vector:
    """The joint positions of the scene at its start."""
    model = build(endoscope.params)
    positions = model.qpos0.copy()
    positions[
        [model.joint(f"ECM/{joint.name}").qposadr[0] for joint in endoscope.params.arms["ECM"].chain.joints]
    ] = ECM_START
    return positions


def shoot(endoscope: Endoscope, t: int = 0) -> Outputs:
    with endoscope:
        endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        return dict(endoscope.step(t, PERIOD_NS, Inputs({"qpos": state(endoscope)})))


def pixels(image: Any) -> NDArray[np.uint8]:
    assert isinstance(image, Image)
    return image.data.reshape(image.height, image.width, 3)


def bright_spots(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """The middle (u, v) of each yellow spot, shape (n, 2): red and not blue, unlike all else here."""
    from scipy import ndimage

    red, blue = picture[:, :, 0].astype(float), picture[:, :, 2].astype(float)
    spots, count = ndimage.label((red > 4.0) & (red > 2.0 * blue))
    middles = ndimage.center_of_mass(np.ones(spots.shape), spots, range(1, count + 1))
    return np.array(middles).reshape(-1, 2)[:, ::-1]


@pytest.mark.parametrize(
    "lens",
    [
        {},
        {"endoscope": "up"},
        {"endoscope": "down", "width": 640, "height": 360},
        {"field_of_view": "70 deg", "baseline": "8 mm", "width": 480},
    ],
)
def test_known_points_are_where_camera_info_projects_them(gl: str, lens: dict[str, Any]) -> None:
    pose = camera_pose(lens.get("endoscope", "straight"))
    points = np.array([(pose @ [x, y, AHEAD, 1.0])[:3] for x, y in SPREAD])
    outputs = shoot(make(points, **lens))
    left_in_world = pose.copy()
    left_in_world[:3, 3] -= 0.5 * make(**lens).params.baseline * pose[:3, 0]
    in_left = np.linalg.inv(left_in_world) @ np.column_stack([points, np.ones(len(points))]).T  # (4, n)
    for eye in EYES:
        (info,), (image,) = outputs[f"{eye}/camera_info"], outputs[f"{eye}/image_raw"]
        assert isinstance(info, CameraInfo)
        projected = info.p.reshape(3, 4) @ in_left
        expected = (projected[:2] / projected[2]).T
        seen = bright_spots(pixels(image))
        assert len(seen) == len(expected)
        for point in expected:
            assert np.linalg.norm(seen - point, axis=1).min() < 0.5, f"{seen - point}"


def test_the_calibration_is_that_of_a_rectified_stereo_pair(gl: str) -> None:
    outputs = shoot(make(), t=3_000_000_001)
    infos = [outputs[f"{eye}/camera_info"][0] for eye in EYES]
    images = [outputs[f"{eye}/image_raw"][0] for eye in EYES]
    for info, image in zip(infos, images, strict=True):
        assert isinstance(info, CameraInfo)
        assert isinstance(image, Image)
        assert info.header == image.header
        assert (info.header.frame_id, info.header.stamp.ns) == ("endoscope_left_optical", 3_000_000_001)
        assert (info.width, info.height, image.width, image.height) == (320, 288, 320, 288)
        assert (image.encoding, image.step, image.data.size) == ("rgb8", 960, 276_480)
        assert info.k[0] == pytest.approx(160.0 / np.tan(np.pi / 6))
        assert np.array_equal(info.p.reshape(3, 4)[:, :3], info.k.reshape(3, 3))
        assert not info.d.any()
    assert [info.p[3] for info in infos] == [0.0, pytest.approx(-infos[1].k[0] * 5.06e-3)]


@pytest.mark.parametrize("format_", ["jpeg", "png"])
def test_compressed_pictures_show_the_same(gl: str, format_: str) -> None:
    points = camera_pose()[:3, 3] + AHEAD * camera_pose()[:3, 2] + np.zeros((1, 3))
    outputs = shoot(make(points, images="both", format=format_))
    for eye in EYES:
        (raw,), (compressed,) = outputs[f"{eye}/image_raw"], outputs[f"{eye}/image_raw/compressed"]
        assert isinstance(compressed, CompressedImage)
        assert compressed.format == format_
        file = Picture.open(BytesIO(compressed.data.tobytes()))
        assert (file.format, file.size) == (format_.upper(), (320, 288))
        difference = np.abs(np.asarray(file).astype(int) - pixels(raw))
        assert pixels(raw).any()
        assert difference.max() == 0 if format_ == "png" else difference.mean() < 1.0


def test_only_what_is_asked_for_has_a_port() -> None:
    assert {port.name for port in make(images="compressed").ports} == {
        "qpos",
        *(f"{eye}/{name}" for eye in EYES for name in ("camera_info", "image_raw/compressed")),
    }


def test_a_camera_that_is_off_draws_nothing_and_has_the_same_state(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opengl, "find", lambda: pytest.fail("it looked for OpenGL"))
    endoscope = make(images="none")
    assert [port.name for port in endoscope.ports] == ["qpos"]
    assert shoot(endoscope) == {}
    assert np.frombuffer(endoscope.save()).tolist() == state(endoscope).tolist()


def test_cameras_that_stand_in_the_world_look_at_their_target(gl: str) -> None:
    target = [0.1, -0.2, 0.3]
    outputs = shoot(
        make(np.array([target]), view={"position": [0.25, -0.2, 0.35], "target": target}, baseline="0 mm")
    )
    for eye in EYES:
        (spot,) = bright_spots(pixels(outputs[f"{eye}/image_raw"][0]))
        assert spot == pytest.approx([159.5, 143.5], abs=0.5)


def test_without_an_ecm_the_cameras_see_the_scene(gl: str) -> None:
    cube = {"kind": "block", "position": [0.2, -0.2, -0.1], "size": ["4 cm"] * 3}
    scene = {"arms": {"PSM1": {"instrument": "400006"}}, "objects": {"cube": cube}, "looks": False}
    endoscope = Endoscope("camera", EndoscopeParams.model_validate(scene))
    with endoscope:
        endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        outputs = endoscope.step(0, PERIOD_NS, Inputs({"qpos": np.asarray(build(endoscope.params).qpos0)}))
    assert len(bright_spots(pixels(outputs["left/image_raw"][0]))) == 1


@pytest.mark.parametrize(
    "scene",
    [
        {"arms": {"PSM1": {}}},
        {"arms": {"PSM3": {"instrument": "400006"}, "ECM": {}}},
        {
            "arms": {"PSM1": {"instrument": "420006"}, "PSM2": {"instrument": "400049"}, "ECM": {}},
            "mounting": "cart",
        },
        {
            "arms": {"PSM2": {}},
            "objects": {
                "ring": {"kind": "ring", "position": [0, 0, 0]},
                "needle": {"kind": "needle", "position": [0, 0, 0], "thread": {}},
            },
        },
    ],
)
def test_the_number_of_positions_is_known_before_the_model_is_built(scene: dict[str, Any]) -> None:
    params = EndoscopeParams.model_validate({**scene, "looks": False})
    assert position_count(params) == build(params).nq
    assert Endoscope("endoscope", params).ports[0].size == build(params).nq


def test_a_needle_with_a_thread_brings_it_as_a_soft_body_and_one_without_does_not() -> None:
    needle = {"kind": "needle", "position": [0, 0, 0]}
    for thread, bodies in ((None, []), ({"length": "80 mm"}, ["thread/nodes"])):
        scene = {"arms": {"ECM": {}}, "objects": {"needle": needle | {"thread": thread}}, "looks": False}
        ports = Endoscope("endoscope", EndoscopeParams.model_validate(scene)).ports
        assert [port.name for port in ports if port.name.endswith("/nodes")] == bodies


def test_it_keeps_the_contract_of_an_engine(gl: str) -> None:
    check_engine(make, period_ns=PERIOD_NS, inputs={"qpos": state(make())})


def test_without_opengl_it_runs_without_pictures_and_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(opengl, "find", lambda: NOTHING)
    with caplog.at_level(logging.WARNING):
        outputs = shoot(make(images="both"))
    assert set(outputs.values()) == {()}
    assert len(outputs) == 6
    (record,) = caplog.records
    assert NOTHING.detail in record.message
    assert "apt-get install libosmesa6" in record.message
    check_engine(make, period_ns=PERIOD_NS, inputs={"qpos": state(make())})


def test_the_state_hash_does_not_depend_on_what_draws(gl: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def hashes() -> list[int]:
        with make() as endoscope:
            endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
            found = [endoscope.state_hash()]
            endoscope.step(0, PERIOD_NS, Inputs({"qpos": state(endoscope)}))
            return [*found, endoscope.state_hash()]

    drawn = hashes()
    monkeypatch.setattr(opengl, "find", lambda: NOTHING)
    assert hashes() == drawn
    assert drawn[0] != drawn[1]


def test_a_state_of_another_scene_is_refused() -> None:
    with pytest.raises(StateError, match="3 bytes"):
        make().restore(b"abc")


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"view": {"position": [1, 0, 0], "target": [1, 0, 0]}}, "no direction"),
        ({"near": "20 mm", "far": "10 mm"}, "beyond near"),
        ({"width": 5000}, "2048"),
        ({"field_of_view": "180 deg"}, "less than 3"),
    ],
)
def test_cameras_that_cannot_be_are_refused(params: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(**params)


@pytest.mark.parametrize("view", [None, {"position": [0.1, 1.3, 1.0], "target": [0.05, 1.1, 0.9]}])
def test_leaving_out_what_no_camera_sees_changes_no_pixel(
    gl: str, view: dict[str, Any] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
    from engines.mujoco.pictures.stereo import StereoRenderer

    params: dict[str, Any] = {
        "mounting": "cart",
        "arms": {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006"}, "ECM": {"start": [0, 0, "0.1 m", 0]}},
        "table": {"position": [0.05, 1.1, 0.85], "size": [0.2, 0.15, 0.01]},
        "objects": {"ring": {"kind": "ring", "position": [0.065, 1.115, 0.851]}},
        "width": 64,
        "height": 48,
        "view": view,
    }
    scene = EndoscopeScene(EndoscopeParams.model_validate(params), gl)
    random, start = np.random.default_rng(5), np.zeros(position_count(EndoscopeParams.model_validate(params)))
    start[-4] = 1.0  # of the ring's quaternion
    states = [start + random.normal(0.0, 0.3, start.size) for _ in range(12)]
    some = [np.stack(scene.draw(positions)) for positions in states]
    monkeypatch.setattr(StereoRenderer, "_in_sight", lambda *_: np.True_)
    everything = [np.stack(scene.draw(positions)) for positions in states]
    scene.close()
    assert any(picture.any() for picture in everything)
    for fewer, more in zip(some, everything, strict=True):
        np.testing.assert_array_equal(fewer, more)


def test_truth_is_published_beside_the_pictures_and_agrees_with_them(gl: str) -> None:
    pose = camera_pose()
    points = np.array([(pose @ [x, y, AHEAD, 1.0])[:3] for x, y in SPREAD])
    with make(points, truth=["depth", "segmentation", "instances"]) as endoscope:
        endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        outputs = endoscope.step(0, PERIOD_NS, Inputs({"qpos": state(endoscope)}))
    for eye in EYES:
        (depth,), (classes,), (instances,), (info,) = (
            outputs[f"{eye}/{name}"] for name in ("depth", "segmentation", "instances", "camera_info")
        )
        assert isinstance(depth, Image)
        assert isinstance(classes, Image)
        assert isinstance(instances, Image)
        assert isinstance(info, CameraInfo)
        assert (depth.encoding, classes.encoding) == ("32FC1", "mono16")
        assert (depth.step, classes.step) == (4 * depth.width, 2 * classes.width)
        metres = depth.data.view("<f4").reshape(depth.height, depth.width)
        numbers = instances.data.view("<u2").reshape(depth.height, depth.width)
        seen = metres > 0.0
        assert np.array_equal(seen, classes.data.view("<u2").reshape(seen.shape) == SceneClass.OBJECT)
        assert len(np.unique(numbers[seen])) == len(points)
        assert np.allclose(metres[seen], AHEAD, atol=2e-3)
        (picture,) = outputs[f"{eye}/image_raw"]
        assert np.array_equal(seen, pixels(picture).max(axis=2) > 0)
        assert info.header == depth.header


def test_flow_comes_with_the_next_picture_and_leads_to_it(gl: str) -> None:
    pose = camera_pose()
    points = np.array([(pose @ [x, y, AHEAD, 1.0])[:3] for x, y in SPREAD])
    with make(points, truth=["flow", "scene_flow", "normals"]) as endoscope:
        endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        start = state(endoscope)
        first = endoscope.step(0, PERIOD_NS, Inputs({"qpos": start}))
        turned = start.copy()
        turned[3] += 0.01  # roll of the endoscope, rad: pixels turn about the middle of the picture
        later = endoscope.step(PERIOD_NS, PERIOD_NS, Inputs({"qpos": turned}))
    assert first["left/flow"] == first["left/scene_flow"] == ()
    for eye in EYES:
        (flow,), (moved,), (normals,) = (later[f"{eye}/{name}"] for name in ("flow", "scene_flow", "normals"))
        assert isinstance(flow, Image)
        assert isinstance(moved, Image)
        assert isinstance(normals, Image)
        assert (flow.encoding, moved.encoding, normals.encoding) == ("32FC2", "32FC3", "32FC3")
        assert (flow.header.stamp, normals.header.stamp) == (Time.from_ns(0), Time.from_ns(PERIOD_NS))
        pixel = flow.data.view("<f4").reshape(flow.height, flow.width, 2)
        rows, columns = np.nonzero(np.isfinite(pixel[..., 0]))
        assert rows.size
        from_middle = np.hypot(columns - 0.5 * (flow.width - 1), rows - 0.5 * (flow.height - 1))
        sizes = np.linalg.norm(pixel[rows, columns], axis=1)
        assert np.allclose(sizes, 0.01 * from_middle, atol=0.15)  # px, for the distance of the eyes
        assert np.nanmax(np.abs(moved.data.view("<f4"))) < 1e-6  # the things stand still


@pytest.mark.parametrize(("name", "side"), [("depth", 2048), ("flow", 1400), ("normals", 1100)])
def test_truth_larger_than_a_message_is_refused(name: str, side: int) -> None:
    with pytest.raises(ValueError, match=f"{name} of .* larger than a message"):
        make(truth=[name], width=side, height=side)
