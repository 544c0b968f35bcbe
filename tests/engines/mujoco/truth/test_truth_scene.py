"""Truth beside pictures, judged by ray casting, by moved points and by the calibration of the cameras."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.truth.scene_class import SceneClass
from engines.mujoco.truth.sight import Sight
from engines.mujoco.truth.truth_scene import Instant, TruthScene
from robots.dvrk.endoscope import EYES
from schemas.ros import Header
from schemas.trocar_msgs import SoftBodyState, SurfaceFilm
from schemas.vectors import Vector
from tests.engines.mujoco.truth.rays import cast_geoms, cast_mesh
from tests.engines.mujoco.truth.scenes import OBJECTS, TISSUE, Tissue, start_positions
from tests.engines.tissue.cut_block import CutBlock

EDGE_M = 0.1e-3


@pytest.fixture(scope="module")
def gl() -> str:
    found = opengl.find()
    if not found.name:
        pytest.skip(f"no OpenGL: {found.detail}")
    return found.name


@pytest.fixture
def tissue() -> Tissue:
    return Tissue()


@pytest.fixture
def over_tissue(gl: str, tissue: Tissue) -> Iterator[TruthScene]:
    scene = TruthScene(EndoscopeParams.model_validate(TISSUE), gl, {"liver": tissue.body})
    yield scene
    scene.close()


def objects(gl: str, **changed: Any) -> TruthScene:
    return TruthScene(EndoscopeParams.model_validate(OBJECTS | changed), gl)


def interior(bodies: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Pixels whose neighbours, all eight, show the same body."""
    padded = np.pad(bodies, 1, mode="edge")
    height, width = bodies.shape
    shifted = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.all([one == bodies for one in shifted], axis=0)


def cast_scene(scene: TruthScene, instant: Instant, sight: Sight) -> tuple[NDArray[np.int64], Vector]:
    """Number of the body, and depth, by rays through all pixels; rays at soft bodies where truth has some."""
    rays, names = sight.view.projection.rays.reshape(-1, 3), {body.name: body.id for body in scene.bodies}
    cast = cast_geoms(scene.model, scene.data, sight.view, rays)
    body = np.array([names[scene.model.body(i).name] if i >= 0 else 0 for i in cast.body])
    depth = cast.depth.copy()
    if "liver" in names:
        # rays elsewhere would take minutes: a soft body that truth misses is seen by the pixels beside it
        grown = np.pad(sight.bodies == names["liver"], 1)
        near = np.any(
            [
                grown[y : y + sight.hit.shape[0], x : x + sight.hit.shape[1]]
                for y in range(3)
                for x in range(3)
            ],
            axis=0,
        )
        soft = instant.surfaces.bodies == names["liver"]
        corners = sight.view.to_camera(instant.vertices)[instant.surfaces.faces[soft]]
        chosen = np.flatnonzero(near.ravel())
        found = np.full(len(rays), np.inf)
        found[chosen] = cast_mesh(corners, rays[chosen])
        body, depth = np.where(found < depth, names["liver"], body), np.minimum(found, depth)
    return body.reshape(sight.hit.shape), depth.reshape(sight.hit.shape)


@pytest.mark.long
@pytest.mark.parametrize("what", ["tissue", "objects", "distorted"])
def test_segmentation_and_depth_are_those_of_rays(gl: str, tissue: Tissue, what: str) -> None:
    chosen = TISSUE if what == "tissue" else OBJECTS
    if what == "distorted":
        chosen = OBJECTS | {"distortion": [-0.2, 0.05, 1e-3, -1e-3, 0.0]}
    params = EndoscopeParams.model_validate(chosen)
    scene = TruthScene(params, gl, {"liver": tissue.body} if what == "tissue" else {})
    instant = scene.look(start_positions(params), ("left",))
    sight = instant.sights["left"]
    body, depth = cast_scene(scene, instant, sight)
    same = body == sight.bodies
    assert len(np.unique(sight.bodies)) > 4
    assert same[interior(sight.bodies)].all()
    # a distorted edge is where the finer drawn pixels are: off by up to a sixth of a pixel
    assert same.mean() > (0.995 if what == "distorted" else 0.999)
    shown = same & sight.hit & interior(sight.bodies)
    assert np.quantile(np.abs(depth - sight.depth)[shown], 0.99 if what == "distorted" else 0.999) < EDGE_M
    assert np.abs(depth - sight.depth)[shown].max() < 1e-3
    scene.close()


def test_points_of_bodies_flow_as_the_bodies_move(over_tissue: TruthScene, tissue: Tissue) -> None:
    params = EndoscopeParams.model_validate(TISSUE)
    positions, moved = start_positions(params), start_positions(params)
    before = over_tissue.look(positions)
    model, data = over_tissue.model, over_tissue.data
    places = data.xpos.copy(), data.xmat.reshape(-1, 3, 3).copy()
    for joint, by in (("PSM1/yaw", 0.05), ("PSM1/roll", 0.3), ("ECM/roll", 0.05), ("ECM/insertion", 4e-3)):
        moved[model.joint(joint).qposadr[0]] += by
    shift = np.array([1e-3, -2e-3, 0.5e-3])
    tissue.move(tissue.nodes + shift)
    now = over_tissue.look(moved)
    for eye in EYES:
        motion, sight = over_tissue.motion(before, eye, now), before.sights[eye]
        rows, columns = np.nonzero(sight.hit)
        rays = sight.view.projection.rays[sight.hit]
        points = sight.view.pose[:3, 3] + (rays * sight.depth[sight.hit][:, None]) @ sight.view.pose[:3, :3].T
        after = points + shift  # of the liver
        for number, body in enumerate(over_tissue.bodies, 1):
            if body.name != "liver":
                i, of_body = model.body(body.name).id, sight.bodies[sight.hit] == number
                local = (points[of_body] - places[0][i]) @ places[1][i]
                after[of_body] = data.xpos[i] + local @ data.xmat[i].reshape(3, 3).T
        view = now.sights[eye].view
        expected = view.projection.project(view.to_camera(after)) - np.stack([columns, rows], axis=1)
        error = np.linalg.norm(motion.flow[sight.hit] - expected, axis=1)
        assert np.median(np.linalg.norm(expected, axis=1)) > 1.0
        assert np.median(error) < 1e-3
        assert np.quantile(error, 0.99) < 0.1
        in_camera = (after - points) @ sight.view.pose[:3, :3]
        assert np.quantile(np.abs(motion.scene_flow[sight.hit] - in_camera), 0.99) < 1e-5
        assert np.isnan(motion.flow[~sight.hit]).all()


def test_flow_leads_to_the_same_body_unless_hidden(over_tissue: TruthScene) -> None:
    params = EndoscopeParams.model_validate(TISSUE)
    positions = start_positions(params)
    before = over_tissue.look(positions)
    positions[over_tissue.model.joint("PSM1/insertion").qposadr[0]] += 0.02
    now = over_tissue.look(positions)
    motion, sight, later = over_tissue.motion(before, "left", now), before.sights["left"], now.sights["left"]
    inside = interior(sight.bodies) & motion.is_visible & sight.hit
    rows, columns = np.nonzero(inside)
    u, v = np.rint(np.stack([columns, rows]) + motion.flow[inside].T).astype(int)
    kept = (u >= 0) & (v >= 0) & (u < later.hit.shape[1]) & (v < later.hit.shape[0])
    assert (sight.bodies[inside][kept] == later.bodies[v[kept], u[kept]]).mean() > 0.98
    liver = next(body.id for body in over_tissue.bodies if body.name == "liver")
    assert (~motion.is_visible & (sight.bodies == liver)).any()  # the instrument came before it


def test_a_still_scene_does_not_flow(over_tissue: TruthScene) -> None:
    positions = start_positions(EndoscopeParams.model_validate(TISSUE))
    before = over_tissue.look(positions)
    motion, hit = over_tissue.motion(before, "left", over_tissue.look(positions)), before.sights["left"].hit
    assert np.abs(motion.flow[hit]).max() < 1e-9
    assert motion.is_visible[hit].mean() > 0.999


def test_normals_turn_towards_the_camera(over_tissue: TruthScene) -> None:
    sight = over_tissue.look(start_positions(EndoscopeParams.model_validate(TISSUE))).sights["left"]
    normals = sight.normals[sight.hit]
    rays = sight.view.projection.rays[sight.hit]
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    assert ((normals * rays).sum(axis=1) < 1e-3).all()


def test_cut_tissue_and_blood_have_classes_of_their_own(gl: str) -> None:
    block = CutBlock(np.array([0.08, 0.06, 0.02]), 250)
    soft = SoftBody("liver/nodes", may_change=True, may_be_wet=True)
    scene_params = TISSUE | {"view": {"position": [0.0, 0.0, 0.1], "target": [0.0, 1e-3, 0.0]}}

    def nodes(places: Vector, *, first: bool = False) -> SoftBodyState:
        faces = block.mesh.triangles.astype(np.uint32).ravel() if first else np.zeros(0, np.uint32)
        return SoftBodyState(
            header=Header(frame_id="world"),
            body="liver",
            nodes_m=places.astype(np.float32).ravel(),
            triangles=faces,
        )

    soft.accept(nodes(block.mesh.nodes, first=True), block.surface.change("liver", 0))
    params = EndoscopeParams.model_validate(scene_params)
    scene = TruthScene(params, gl, {"liver": soft})
    positions = start_positions(params)
    whole = scene.look(positions)
    assert (whole.sights["left"].classes == SceneClass.LIVER).mean() > 0.2
    assert not (whole.sights["left"].classes == SceneClass.CUT).any()
    block.cut(0.012)
    wet = SurfaceFilm(
        header=Header(),
        body="liver",
        liquid="blood",
        nodes=np.arange(40, dtype=np.uint32),
        thickness=np.full(40, 20, np.uint8),
    )
    soft.accept(nodes(block.part(0.01)), block.surface.change("liver", 1), wet)
    cut = scene.look(positions)
    classes = cut.sights["left"].classes
    assert (classes == SceneClass.CUT).sum() > 0.01 * classes.size
    assert (classes == SceneClass.BLOOD).any()
    # the halves have moved apart, 5 mm each
    motion = scene.motion(whole, "left", cut)
    sideways = np.linalg.norm(motion.scene_flow[whole.sights["left"].classes == SceneClass.LIVER], axis=1)
    assert 3e-3 < np.median(sideways) < 8e-3
    block.surface.remove(np.arange(len(block.surface.faces)))
    soft.accept(nodes(block.part(0.01)), block.surface.change("liver", 2))
    assert not (scene.look(positions).sights["left"].bodies == scene.bodies[-1].id).any()
    scene.close()


def test_keypoints_are_where_the_calibration_projects_them(over_tissue: TruthScene) -> None:
    params = EndoscopeParams.model_validate(TISSUE)
    sights = over_tissue.look(start_positions(params)).sights
    (instrument,) = over_tissue.instruments
    left_from_world = np.linalg.inv(sights["left"].view.pose)
    tip = left_from_world @ [*over_tissue.data.site("PSM1/tip").xpos, 1.0]
    for eye in EYES:
        found = instrument.keypoints(over_tissue.data, sights[eye], over_tissue.bodies)
        assert list(found)[:4] == ["shaft_end", "wrist_pitch", "wrist_yaw", "tip"]
        projected = params.camera.projection(eye) @ tip
        assert np.allclose(found["tip"].pixel, projected[:2] / projected[2], atol=1e-9)
        assert found["tip"].visibility == 2
    pose = instrument.tip_pose(over_tissue.data, sights["left"].view)
    assert np.allclose(pose[:3, 3], tip[:3])


def test_a_keypoint_behind_an_object_is_hidden(gl: str) -> None:
    start = {"PSM1": {**OBJECTS["arms"]["PSM1"], "start": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]}}
    params = EndoscopeParams.model_validate(OBJECTS | {"arms": start})
    tip = params.arms["PSM1"].chain.forward(np.array(params.arms["PSM1"].start))[:3, 3] + [0.0, 0.0, 0.12]
    camera = np.array(OBJECTS["view"]["position"])
    for share, expected in ((1.5, 2), (0.6, 1)):
        block = {
            "kind": "block",
            "size": ["12 mm"] * 3,
            "position": (camera + share * (tip - camera)).tolist(),
        }
        params = EndoscopeParams.model_validate(
            OBJECTS | {"arms": start, "objects": {"block": block}, "table": None}
        )
        scene = TruthScene(params, gl)
        sight = scene.look(start_positions(params)).sights["left"]
        (instrument,) = scene.instruments
        assert instrument.keypoints(scene.data, sight, scene.bodies)["tip"].visibility == expected
        scene.close()


def test_shaft_edges_bound_the_shaft(over_tissue: TruthScene) -> None:
    sight = over_tissue.look(start_positions(EndoscopeParams.model_validate(TISSUE))).sights["left"]
    (instrument,) = over_tissue.instruments
    edges = instrument.shaft_edges(over_tissue.data, sight.view)
    assert len(edges) == 2
    rows, columns = np.nonzero(sight.classes == SceneClass.SHAFT)
    pixels = np.stack([columns, rows], axis=1).astype(float)
    sides = []
    for start, end in edges:
        along = (end - start) / np.linalg.norm(end - start)
        sides.append((pixels - start) @ [-along[1], along[0]])
    low, high = sorted(sides, key=lambda side: float(side.mean()))
    # between both edges, and close to each; the drawn shaft has twelve sides
    assert high.min() > -1.0
    assert low.max() < 1.0
    assert high.min() < 1.5
    assert low.max() > -1.5


def test_a_hook_is_the_working_end_of_its_instrument(gl: str) -> None:
    arm = {**TISSUE["arms"]["PSM1"], "instrument": "PERMANENT_CAUTERY_HOOK_400183"}
    params = EndoscopeParams.model_validate(TISSUE | {"arms": TISSUE["arms"] | {"PSM1": arm}, "skins": {}})
    scene = TruthScene(params, gl)
    sight = scene.look(start_positions(params), ("left",)).sights["left"]
    assert (sight.classes == SceneClass.JAW).any()
    (instrument,) = scene.instruments
    points = instrument.keypoints(scene.data, sight, scene.bodies)
    u, v = np.rint(points["wrist_yaw_end"].pixel).astype(int)
    assert SceneClass.JAW in sight.classes[v - 1 : v + 2, u - 1 : u + 2]
    scene.close()


_SCREEN_FIRST = """
import OpenGL.GL  # before the choice of an OpenGL without a screen
import numpy as np
from engines.mujoco.truth.id_buffer import IdBuffer
corners = np.array([[[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [0.0, 1.0, 1.0]]])
intrinsics = np.array([[8.0, 0.0, 7.5], [0.0, 8.0, 7.5], [0.0, 0.0, 1.0]])
buffer = IdBuffer({gl!r}, (16, 16))
for order in (corners, corners[:, ::-1]):
    print(sorted(set(buffer.draw(order, intrinsics, (0.1, 10.0)).ravel().tolist())))
"""


def test_it_draws_where_something_else_has_imported_opengl(gl: str) -> None:
    if gl != "egl":
        pytest.skip("PyOpenGL loads the functions of EGL and GLX from one library, of OSMesa from another")
    done = subprocess.run(
        [sys.executable, "-c", _SCREEN_FIRST.format(gl=gl)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert sorted(done.stdout.splitlines()) == ["[-1, 0]", "[-1]"]
