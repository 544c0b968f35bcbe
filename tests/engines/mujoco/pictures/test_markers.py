"""Markers in the endoscope's pictures: where they are in either eye, what hides them, what changes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engines.mujoco.markers.participant import Markers, MarkersParams
from engines.mujoco.model import build
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope import Endoscope
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.testing import check_engine
from hub.verify import verify
from robots.dvrk.endoscope import EYES, optical_in_roll
from schemas.codec import decode
from schemas.errors import StateError
from schemas.ros import Image
from schemas.trocar_msgs import ShownMarkers
from schemas.vectors import Vector
from schemas.visualization import Marker, MarkerArray, MarkerType

pytestmark = pytest.mark.xdist_group("markers in pictures")  # one scene, made once
ECM_START = [0.3, -0.2, 0.1, 0.4]
ECM = EndoscopeParams.model_validate({"arms": {"ECM": {"start": ECM_START}}}).arms["ECM"]
POSE = ECM.chain.forward(np.array(ECM_START)) @ optical_in_roll("straight")
"""The optical frame midway between the eyes, in the world."""
BLOCK = (POSE @ [0.0, 0.0, 0.1, 1.0])[:3]
"""The scene's only object: a cube of 20 mm, 100 mm ahead."""
SCENE: dict[str, Any] = {
    "arms": {"ECM": {"start": ECM_START}},
    "objects": {"block": {"kind": "block", "size": ["20 mm"] * 3, "position": BLOCK.tolist()}},
    "looks": False,
}
RED, GREEN, BLUE = ({"r": 1.0, "a": 1.0}, {"g": 1.0, "a": 1.0}, {"b": 1.0, "a": 1.0})
STEP_NS = 40_000_000
AHEAD = 0.08
Pictures = tuple[NDArray[np.float64], NDArray[np.float64]]


def positions() -> Vector:
    model = build(EndoscopeParams.model_validate(SCENE))
    start = model.qpos0.copy()
    start[[model.joint(f"ECM/{joint.name}").qposadr[0] for joint in ECM.chain.joints]] = ECM_START
    return start


QPOS = positions()


class Scene:
    """A store and an endoscope, stepped as in a session."""

    def __init__(self) -> None:
        self.markers = Markers("markers", MarkersParams.model_validate(SCENE))
        self.endoscope = Endoscope("endoscope", EndoscopeParams.model_validate(SCENE | {"markers": True}))
        self.t = 0
        for participant in (self.markers, self.endoscope):
            participant.configure(Setup(STEP_NS, Path.cwd()))

    def shown(self, *messages: MarkerArray, qpos: Vector = QPOS) -> tuple[ShownMarkers, str]:
        inputs = Inputs({"qpos": qpos}, events={"markers": messages} if messages else {})
        outputs = self.markers.step(self.t, STEP_NS, inputs)
        self.t += STEP_NS
        shown, told = outputs["shown"], outputs["error"]
        assert isinstance(shown, ShownMarkers)
        assert isinstance(told, tuple)
        return shown, " ".join(one.model_dump()["data"] for one in told)

    def pictures(self, *markers: dict[str, Any], qpos: Vector = QPOS) -> Pictures:
        """Show these markers alone; return the pictures of both eyes."""
        everything = MarkerArray(
            markers=[Marker(action=3), *(marker(number, **m) for number, m in enumerate(markers))]
        )
        shown, told = self.shown(everything, qpos=qpos)
        assert told == ""
        outputs = self.endoscope.step(self.t, STEP_NS, Inputs({"qpos": qpos, "markers": shown}))
        left, right = (outputs[f"{eye}/image_raw"] for eye in EYES)
        return pixels(left), pixels(right)


@pytest.fixture(scope="module")
def scene():
    found = opengl.find()
    if not found.name:
        pytest.skip(f"no OpenGL: {found.detail}")
    made = Scene()
    yield made
    made.endoscope.close()


def marker(number: int, at: Any = (0.0, 0.0, 0.0), size: Any = (2e-3, 2e-3, 2e-3), **fields: Any) -> Marker:
    x, y, z = (float(value) for value in at)
    return Marker.model_validate(
        {
            "header": {"frame_id": fields.pop("frame", "world")},
            "id": number,
            "type": MarkerType.SPHERE,
            "pose": {"position": {"x": x, "y": y, "z": z}},
            "scale": dict(zip("xyz", map(float, size), strict=True)),
            "color": RED,
            "frame_locked": True,
        }
        | fields
    )


def pixels(value: Any) -> NDArray[np.float64]:
    (image,) = value
    assert isinstance(image, Image)
    return image.data.reshape(image.height, image.width, 3).astype(float)


def of_color(picture: NDArray[np.float64], color: int = 0) -> NDArray[np.bool_]:
    """Which pixels are of one colour alone."""
    others = np.delete(picture, color, axis=2).max(axis=2)
    return (picture[:, :, color] > 60.0) & (picture[:, :, color] > 3.0 * others)


def middle(picture: NDArray[np.float64], color: int = 0) -> NDArray[np.float64]:
    """The middle (u, v) of what is of one colour alone."""
    rows, columns = np.nonzero(of_color(picture, color))
    return np.array([columns.mean(), rows.mean()]) if len(rows) else np.array([])


def projected(point: Vector, eye: int) -> NDArray[np.float64]:
    """Where a point of the world is in a picture, by the camera's calibration."""
    camera = EndoscopeParams.model_validate(SCENE).camera
    left = POSE.copy()
    left[:3, 3] -= 0.5 * camera.baseline * POSE[:3, 0]
    u, v, w = camera.projection(EYES[eye]) @ np.linalg.inv(left) @ [*point, 1.0]
    return np.array([u, v]) / w


@pytest.mark.parametrize("frame", ["world", "ECM", "endoscope_left_optical", "ECM_base", "block"])
def test_a_marker_is_where_the_camera_projects_it_in_either_eye(scene: Scene, frame: str) -> None:
    import mujoco

    point = (POSE @ [0.03, 0.02, AHEAD, 1.0])[:3]
    data = mujoco.MjData(scene.markers._model)
    data.qpos[:] = QPOS
    mujoco.mj_kinematics(scene.markers._model, data)
    local = np.linalg.inv(scene.markers._poses.pose(frame, data)) @ [*point, 1.0]
    seen = [middle(picture) for picture in scene.pictures({"at": local[:3], "frame": frame})]
    for eye in (0, 1):
        assert np.linalg.norm(seen[eye] - projected(point, eye)) < 0.5
    disparity, expected = seen[0] - seen[1], 160.0 / np.tan(np.pi / 6) * 5.06e-3 / AHEAD
    assert abs(disparity[0] - expected) < 0.5
    assert abs(disparity[1]) < 0.1


def test_what_is_nearer_hides_a_marker_and_a_transparent_one_shows_what_is_behind(scene: Scene) -> None:
    before, behind = ((POSE @ [0.0, 0.0, z, 1.0])[:3] for z in (0.08, 0.13))
    bare, _ = scene.pictures()
    (hidden, _), (seen, _) = scene.pictures({"at": behind}), scene.pictures({"at": before})
    np.testing.assert_array_equal(hidden, bare)
    assert middle(seen).size == 2
    pane = {"at": before, "size": (6e-3, 6e-3, 1e-4), "type": MarkerType.CUBE}
    (clear, _), (solid, _) = (
        scene.pictures(pane | {"color": {"b": 1.0, "a": alpha}}) for alpha in (0.4, 1.0)
    )
    where = solid[:, :, 2] > bare[:, :, 2] + 20.0
    assert where.sum() > 50
    red = [picture[where][:, 0].mean() for picture in (bare, clear, solid)]
    assert red[0] > red[1] > red[2]  # the yellow block shines through


def test_colour_number_place_and_text_change_from_picture_to_picture(scene: Scene) -> None:
    here, there = ((POSE @ [x, -0.02, AHEAD, 1.0])[:3] for x in (-0.03, 0.03))
    (first, _), (second, _) = (
        scene.pictures({"at": here, "color": RED}),
        scene.pictures({"at": there, "color": GREEN}, {"at": here, "color": BLUE}),
    )
    assert middle(first)[0] < 160.0
    assert not middle(second).size
    assert middle(second, 1)[0] > 160.0 > middle(second, 2)[0]
    banner = {"at": here, "type": MarkerType.TEXT_VIEW_FACING, "size": (0.0, 0.0, 5e-3)}
    words = [scene.pictures(banner | {"text": text})[0] for text in ("Insert", "Extract")]
    counts = [int(of_color(picture).sum()) for picture in words]
    assert 0 < counts[0] < counts[1]


def test_a_text_faces_the_eye_and_has_the_height_that_is_asked_for(scene: Scene) -> None:
    at = (POSE @ [-0.03, -0.02, AHEAD, 1.0])[:3]
    letters = {"at": at, "type": MarkerType.TEXT_VIEW_FACING, "size": (0.0, 0.0, 6e-3), "text": "HHH"}
    turned = {
        "pose": {"position": dict(zip("xyz", at.tolist(), strict=True)), "orientation": {"x": 1.0, "w": 0.0}}
    }
    left, _ = scene.pictures(letters)
    again, _ = scene.pictures(letters | turned)
    np.testing.assert_array_equal(left, again)
    rows = np.nonzero(of_color(left).any(axis=1))[0]
    expected = 160.0 / np.tan(np.pi / 6) * 6e-3 / AHEAD
    assert abs(rows.max() - rows.min() + 1 - 1.13 * expected) < 2.0  # a stroke is 0.13 thick


@pytest.mark.parametrize(
    ("kind", "size", "points"),
    [
        (MarkerType.CUBE, (4e-3, 4e-3, 4e-3), ()),
        (MarkerType.CYLINDER, (8e-3, 8e-3, 1e-3), ()),
        (MarkerType.ARROW, (10e-3, 1e-3, 2e-3), ()),
        (MarkerType.ARROW, (1e-3, 2e-3, 0.0), ((0, 0, 0), (0, 8e-3, 0))),
        (MarkerType.ARROW_STRIP, (1e-3, 2e-3, 0.0), ((0, 0, 0), (0, 8e-3, 0), (8e-3, 8e-3, 0))),
        (MarkerType.LINE_STRIP, (1e-3, 0, 0), ((0, 0, 0), (8e-3, 0, 0), (8e-3, 8e-3, 0))),
        (MarkerType.LINE_LIST, (1e-3, 0, 0), ((0, 0, 0), (8e-3, 0, 0))),
        (MarkerType.CUBE_LIST, (2e-3, 2e-3, 2e-3), ((0, 0, 0), (8e-3, 0, 0))),
        (MarkerType.SPHERE_LIST, (2e-3, 2e-3, 2e-3), ((0, 0, 0), (8e-3, 0, 0))),
        (MarkerType.POINTS, (2e-3, 2e-3, 0), ((0, 0, 0), (8e-3, 0, 0))),
        (MarkerType.TRIANGLE_LIST, (1, 1, 1), ((0, 0, 0), (8e-3, 0, 0), (0, 8e-3, 4e-3))),
        (MarkerType.TRIANGLE_LIST, (1, 1, 1), ((0, 0, 0), (0, 8e-3, 4e-3), (8e-3, 0, 0))),
        (MarkerType.MESH_RESOURCE, (0.2, 0.2, 0.2), ()),
    ],
)
def test_every_kind_of_marker_is_drawn(scene: Scene, kind: MarkerType, size: Any, points: Any) -> None:
    at = (POSE @ [0.03, 0.02, AHEAD, 1.0])[:3]
    fields: dict[str, Any] = {"at": at, "type": kind, "size": size, "mesh_resource": "block"}
    fields["points"] = [dict(zip("xyz", map(float, point), strict=True)) for point in points]
    for picture in scene.pictures(fields):
        assert middle(picture).size == 2


def test_points_have_colours_of_their_own(scene: Scene) -> None:
    at = (POSE @ [0.03, 0.02, AHEAD, 1.0])[:3]
    points, colors = [{"x": 0.0}, {"x": 8e-3}], [GREEN, BLUE]
    for kind in (MarkerType.SPHERE_LIST, MarkerType.POINTS, MarkerType.CUBE_LIST):
        picture, _ = scene.pictures({"at": at, "type": kind, "points": points, "colors": colors})
        assert [middle(picture, color).size for color in range(3)] == [0, 2, 2]


def test_a_marker_in_a_moving_frame_moves_with_it_if_it_is_locked(scene: Scene) -> None:
    moved = QPOS.copy()
    moved[-7:-4] += 0.02 * POSE[:3, 0]  # the block goes to the right
    top = {"frame": "block", "at": -0.02 * POSE[:3, 2]}
    world = {"block": {"position": BLOCK.tolist()}}
    assert world["block"]["position"] == pytest.approx(QPOS[-7:-4])
    shown, _ = scene.shown(
        MarkerArray(
            markers=[Marker(action=3), marker(0, **top), marker(1, **top, color=BLUE, frame_locked=False)]
        )
    )
    outputs = scene.endoscope.step(scene.t, STEP_NS, Inputs({"qpos": moved, "markers": shown}))
    left = pixels(outputs["left/image_raw"])
    shift = 160.0 / np.tan(np.pi / 6) * 0.02 / 0.08
    assert middle(left)[0] - middle(left, 2)[0] == pytest.approx(shift, abs=1.0)


def test_more_markers_than_the_scene_had_room_for(scene: Scene) -> None:
    points = [{"x": 1e-4 * i} for i in range(500)]
    at = (POSE @ [-0.02, 0.02, AHEAD, 1.0])[:3]
    left, _ = scene.pictures(
        {"at": at, "type": MarkerType.POINTS, "points": points, "size": (1e-3, 1e-3, 0.0)}
    )
    assert middle(left).size == 2


def test_rejected_markers_are_told_with_their_reasons_and_nothing_else_stops(scene: Scene) -> None:
    bad = [marker(number, frame="PSM9") for number in range(12)]
    shown, told = scene.shown(MarkerArray(markers=[Marker(action=3), *bad, marker(99, at=BLOCK)]))
    assert shown.ids.tolist() == [99]
    assert told.startswith("markers: 12 rejected: marker '' 0: frame_id 'PSM9' is no frame of this scene.")
    assert told.endswith(" and 4 more")
    assert scene.shown()[1] == ""


def test_equal_messages_have_equal_hashes_and_a_state_is_restored(scene: Scene) -> None:
    one, other = Scene(), Scene()
    for made in (one, other):
        made.shown(MarkerArray(markers=[marker(1, at=BLOCK), marker(2, at=BLOCK, lifetime={"sec": 1})]))
    assert one.markers.state_hash() == other.markers.state_hash()
    state, before = one.markers.save(), one.markers.state_hash()
    one.shown(MarkerArray(markers=[marker(1, at=BLOCK, color=BLUE)]))
    assert one.markers.state_hash() != before
    one.markers.restore(state)
    assert one.markers.state_hash() == before
    with pytest.raises(StateError, match="has no markers"):
        one.markers.restore(b"nothing")
    shown, _ = one.shown()
    one.endoscope.step(0, STEP_NS, Inputs({"qpos": QPOS, "markers": shown}))
    drawn, seen = one.endoscope.state_hash(), one.endoscope.save()
    other.endoscope.restore(seen)
    assert other.endoscope.state_hash() == drawn
    with pytest.raises(StateError, match="markers that cannot be read"):
        other.endoscope.restore(seen[:-3])
    for made in (one, other):
        made.endoscope.close()


def test_it_conforms() -> None:
    def make() -> Markers:
        return Markers("markers", MarkersParams.model_validate(SCENE))

    check_engine(make, period_ns=STEP_NS, inputs={"qpos": QPOS})


SESSION = """
name: shown
step: 2 ms
duration: 60 ms
scene:
  arms: {ECM: {position: [45 mm, 0 mm, 200 mm], start: [0, 0, 100 mm, 0]}}
  looks: false
participants:
  sutures: {kind: vrep-sutures}
  robot: {kind: mujoco, publish_period: 10 ms}
  markers: {kind: markers, period: 20 ms}
  endoscope: {kind: endoscope, period: 20 ms, markers: true, width: 64, height: 48}
order: [sutures, robot, markers, endoscope]
connections:
  - sutures.markers -> markers.markers
  - robot.qpos -> markers.qpos
  - robot.qpos -> endoscope.qpos
  - markers.shown -> endoscope.markers
"""


def test_a_session_with_markers_is_simulated_again_bit_for_bit(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "shown.yaml").write_text(SESSION)
    launch(
        load(str(tmp_path / "shown.yaml")),
        endpoint="tcp/127.0.0.1:0",
        record=tmp_path / "seen",
        one_host=True,
    ).run()
    recording = Recording(tmp_path / "seen")
    *_, last = recording.messages("/engine/markers/out/shown")
    assert decode(ShownMarkers, last.payload).texts == ["Teleoperation"]
    assert verify(recording).same
