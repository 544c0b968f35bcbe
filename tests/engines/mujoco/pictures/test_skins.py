"""Soft bodies in the pictures of the endoscope."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope import Endoscope
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
from engines.mujoco.pictures.skin_params import SkinParams
from engines.mujoco.pictures.skins import Skins
from engines.mujoco.pictures.soft_body import SoftBody
from engines.tissue.meshing.grid import block
from hub.participant import Inputs, Outputs, Setup
from hub.testing import check_engine
from robots.dvrk.endoscope import EYES
from schemas.errors import SessionError, StateError
from schemas.ros import CameraInfo, Header
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import Vector
from tests.engines.mujoco.pictures.test_endoscope import (
    AHEAD,
    ECM_START,
    PERIOD_NS,
    SPREAD,
    bright_spots,
    camera_pose,
    pixels,
    state,
)

YELLOW = [0.9, 0.75, 0.0]
OCTAHEDRON = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]) * 1e-3
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]])


@pytest.fixture
def gl() -> str:
    """The OpenGL of this machine; `.ci/run` installs one."""
    found = opengl.find()
    if not found.name:
        pytest.skip(f"no OpenGL: {found.detail}")
    return found.name


def message(nodes: Vector, triangles: NDArray[np.int64] | None = None) -> SoftBodyState:
    faces = np.zeros(0, np.uint32) if triangles is None else triangles.astype(np.uint32).ravel()
    return SoftBodyState(
        header=Header(frame_id="world"),
        body="organ",
        nodes_m=nodes.astype(np.float32).ravel(),
        triangles=faces,
    )


def make(**params: Any) -> Endoscope:
    """An endoscope that sees one soft body, `organ`, and nothing else."""
    scene = {"arms": {"ECM": {"start": ECM_START}}, "looks": False, "skins": {"organ": {"colour": YELLOW}}}
    return Endoscope("endoscope", EndoscopeParams.model_validate(scene | params))


def draw(endoscope: Endoscope, *messages: SoftBodyState | None) -> list[Outputs]:
    with endoscope:
        endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        steps = enumerate(messages)
        return [
            dict(
                endoscope.step(
                    i * PERIOD_NS, PERIOD_NS, Inputs({"qpos": state(endoscope), "organ/nodes": message})
                )
            )
            for i, message in steps
        ]


def octahedra(points: Vector) -> Vector:
    return (points[:, None] + OCTAHEDRON).reshape(-1, 3)


def test_nodes_are_seen_where_camera_info_projects_them(gl: str) -> None:
    pose = camera_pose()
    points = np.array([(pose @ [x, y, AHEAD, 1.0])[:3] for x, y in SPREAD])
    faces = np.concatenate([FACES + 6 * i for i in range(len(points))])
    # the surface comes with another shape than is seen
    rest = octahedra(points + [[0.0, 0.0, 0.01 * i] for i in range(len(points))])
    _, outputs = draw(make(), message(rest, faces), message(octahedra(points)))
    left_in_world = pose.copy()
    left_in_world[:3, 3] -= 0.5 * make().params.baseline * pose[:3, 0]
    in_left = np.linalg.inv(left_in_world) @ np.column_stack([points, np.ones(len(points))]).T  # (4, n)
    for eye in EYES:
        (info,), (image,) = outputs[f"{eye}/camera_info"], outputs[f"{eye}/image_raw"]
        assert isinstance(info, CameraInfo)
        projected = info.p.reshape(3, 4) @ in_left
        seen = bright_spots(pixels(image))
        assert len(seen) == len(points)
        for point in (projected[:2] / projected[2]).T:
            assert np.linalg.norm(seen - point, axis=1).min() < 0.5


def test_all_of_many_soft_bodies_are_seen(gl: str) -> None:
    pose = camera_pose()
    across, down = np.meshgrid(np.linspace(-0.03, 0.03, 15), np.linspace(-0.025, 0.025, 8))
    points = np.array([(pose @ [x, y, AHEAD, 1.0])[:3] for x, y in zip(across.flat, down.flat, strict=True)])
    skins = {f"organ{i}": {"colour": YELLOW} for i in range(len(points))}
    params = make(skins=skins, width=640, height=576).params
    bodies = {name: SoftBody(f"{name}/nodes") for name in skins}
    for point, body in zip(points, bodies.values(), strict=True):
        body.accept(message(octahedra(point[None]), FACES))
    scene = EndoscopeScene(params, gl, bodies)
    picture, _ = scene.draw(state(Endoscope("endoscope", params)))
    scene.close()
    assert len(bright_spots(picture)) == len(points)


def test_a_camera_inside_a_soft_body_is_said_once(gl: str, caplog: pytest.LogCaptureFixture) -> None:
    pose = camera_pose()
    nodes = [pose[:3, 3] + 10.0 * OCTAHEDRON + [shift, 0.0, 0.0] for shift in (0.02, 0.0, 0.02, 0.0)]
    draw(make(), message(nodes[0], FACES), *map(message, nodes[1:]))
    (record,) = caplog.records
    assert "'endoscope': at 0.016 s the camera is inside 'organ'" in record.getMessage()


def skin_of(
    nodes: Vector, triangles: NDArray[np.int64], moved: Vector
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Vertices and normals of the scene that MuJoCo makes of a skin, as any of its renderers draws it."""
    body, scene = SoftBody("organ/nodes"), mujoco.MjSpec()
    body.accept(message(nodes, triangles))
    skins = Skins(scene, {"organ": body}, {"organ": SkinParams()})
    model = scene.compile()
    body.accept(message(moved))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    skins.show(model, data)
    drawn = mujoco.MjvScene(model, 10)
    mujoco.mjv_updateScene(
        model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, drawn
    )
    return drawn.skinvert.reshape(-1, 3).copy(), drawn.skinnormal.reshape(-1, 3).copy()


def test_normals_point_outwards_and_are_those_of_the_sides_of_a_box() -> None:
    mesh = block(np.array([0.08, 0.06, 0.02]), 60)
    shift = np.array([0.1, 0.2, 0.3])
    vertices, normals = skin_of(mesh.nodes, mesh.triangles, mesh.nodes + shift)
    middle = shift - [0.0, 0.0, 0.01]
    sides = (vertices - middle) / [0.04, 0.03, 0.01]  # 1 or -1 where a vertex lies on the side
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    assert np.allclose(np.abs(normals).max(axis=1), 1.0, atol=1e-5)
    assert np.allclose((normals * sides).sum(axis=1), 1.0, atol=1e-5)


def test_a_dent_turns_the_normals_towards_it() -> None:
    mesh = block(np.array([0.08, 0.06, 0.02]), 250)
    pressed = mesh.nodes.copy()
    pressed[:, 2] -= 5e-3 * np.exp(-(pressed[:, :2] ** 2).sum(axis=1) / 0.015**2) * (pressed[:, 2] > -1e-6)
    vertices, normals = skin_of(mesh.nodes, mesh.triangles, pressed)
    slope = (normals[:, 2] > 0.5) & (np.abs(np.linalg.norm(vertices[:, :2], axis=1) - 0.01) < 4e-3)
    assert slope.sum() > 5
    assert ((normals[slope, :2] * vertices[slope, :2]).sum(axis=1) < 0.0).all()
    assert vertices[:, 2].min() >= -0.0201  # nothing goes below the bottom


def test_the_colour_is_that_of_the_tissue_whose_name_the_body_has() -> None:
    assert (
        SkinParams().rgb("liver")
        == SkinParams().rgb("upper_liver")
        == SkinParams.model_validate({"colour": "liver"}).rgb("organ")
    )
    assert SkinParams().rgb("organ") == SkinParams.model_validate({"colour": "tissue"}).rgb("liver")
    assert SkinParams.model_validate({"colour": [0.1, 0.2, 0.3]}).rgb("liver") == (0.1, 0.2, 0.3)
    assert [SkinParams().tissue(name) for name in ("cystic_duct", "hepatic_artery")] == ["duct", "artery"]
    with pytest.raises(ValueError, match="less than or equal to 1"):
        SkinParams.model_validate({"colour": [255, 0, 0]})


def test_it_keeps_the_contract_of_an_engine(gl: str) -> None:
    inputs = {"qpos": state(make()), "organ/nodes": message(OCTAHEDRON, FACES)}
    check_engine(make, period_ns=PERIOD_NS, inputs=inputs)


def test_without_opengl_the_state_is_the_same(gl: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def hashes() -> list[int]:
        with make() as endoscope:
            endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
            found = []
            for nodes in (message(OCTAHEDRON, FACES), message(1.1 * OCTAHEDRON)):
                endoscope.step(0, PERIOD_NS, Inputs({"qpos": state(endoscope), "organ/nodes": nodes}))
                found.append(endoscope.state_hash())
            return found

    drawn = hashes()
    assert drawn[0] != drawn[1]
    monkeypatch.setattr(opengl, "find", lambda: opengl.OpenGL("", "none"))
    assert hashes() == drawn


def test_a_restored_scene_draws_the_same(gl: str) -> None:
    pose = camera_pose()
    rest = pose[:3, 3] + AHEAD * pose[:3, 2] + 5.0 * OCTAHEDRON

    def shoot(endoscope: Endoscope, nodes: Vector) -> NDArray[np.uint8]:
        return pixels(
            endoscope.step(0, PERIOD_NS, Inputs({"qpos": state(endoscope), "organ/nodes": message(nodes)}))[
                "left/image_raw"
            ][0]
        )

    with make() as one, make() as other:
        for endoscope in (one, other):
            endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        one.step(0, PERIOD_NS, Inputs({"qpos": state(one), "organ/nodes": message(rest, FACES)}))
        other.restore(one.save())
        assert other.state_hash() == one.state_hash()
        seen = shoot(other, 1.01 * rest)
        assert seen.any()
        assert np.array_equal(seen, shoot(one, 1.01 * rest))


@pytest.mark.parametrize(
    ("messages", "problem"),
    [
        ([None], "expected the nodes of a soft body"),
        ([message(OCTAHEDRON)], "the first message has no triangles"),
        ([message(OCTAHEDRON, FACES + 1)], "three node indices each, below 6"),
        ([message(OCTAHEDRON, FACES), message(OCTAHEDRON[:5])], "5 nodes, but 6 before"),
    ],
)
def test_what_cannot_be_a_soft_body_is_refused(
    monkeypatch: pytest.MonkeyPatch, messages: list[Any], problem: str
) -> None:
    monkeypatch.setattr(opengl, "find", lambda: opengl.OpenGL("", "none"))
    with pytest.raises(SessionError, match=f"input 'organ/nodes': .*{problem}"):
        draw(make(), *messages)


@pytest.mark.parametrize("state", [b"abc", bytes(1000)])
def test_a_state_of_another_scene_is_refused(state: bytes) -> None:
    with pytest.raises(StateError, match="saved by another scene"):
        make().restore(state)
