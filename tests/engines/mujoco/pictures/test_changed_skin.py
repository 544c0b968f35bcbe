"""Soft bodies with a cut or burnt surface in the pictures of the endoscope."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engines.mujoco.model import build
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope import Endoscope
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.soft_body import SoftBody
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from schemas.errors import SessionError
from schemas.ros import Header
from schemas.soft_surface import FaceKind
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import Vector
from tests.engines.mujoco.pictures.test_endoscope import PERIOD_NS, pixels
from tests.engines.tissue.cut_block import CutBlock

SIZE = np.array([0.08, 0.06, 0.02])
SCENE = {
    "arms": {"PSM1": {"position": [0.0, 0.0, 0.12]}},
    "looks": False,
    "view": {"position": [0.0, 0.0, 0.1], "target": [0.0, 1e-3, 0.0]},
    "skins": {"liver": {"colour": [0.2, 0.8, 0.2]}},
}


@pytest.fixture
def gl() -> str:
    found = opengl.find()
    if not found.name:
        pytest.skip(f"no OpenGL: {found.detail}")
    return found.name


@pytest.fixture
def cut_block() -> CutBlock:
    return CutBlock(SIZE, 250)


def nodes_of(nodes: Vector, triangles: NDArray[np.int64] | None = None) -> SoftBodyState:
    faces = np.zeros(0, np.uint32) if triangles is None else triangles.astype(np.uint32).ravel()
    return SoftBodyState(
        header=Header(frame_id="world"),
        body="liver",
        nodes_m=nodes.astype(np.float32).ravel(),
        triangles=faces,
    )


def make() -> Endoscope:
    return Endoscope("endoscope", EndoscopeParams.model_validate(SCENE))


def configure(endoscope: Endoscope, *connected: str) -> None:
    endoscope.configure(Setup(PERIOD_NS, Path.cwd(), connected=frozenset(connected)))


def step(
    endoscope: Endoscope,
    nodes: SoftBodyState,
    change: SurfaceChange | None,
    film: SurfaceFilm | None = None,
) -> dict[str, Any]:
    inputs: dict[str, Any] = {
        "qpos": build(endoscope.params).qpos0.copy(),
        "liver/nodes": nodes,
        "liver/surface": change,
        "liver/film": film,
    }
    return dict(endoscope.step(0, PERIOD_NS, Inputs(inputs)))


def shoot(
    endoscope: Endoscope,
    nodes: SoftBodyState,
    change: SurfaceChange | None,
    film: SurfaceFilm | None = None,
) -> NDArray[np.int64]:
    return pixels(step(endoscope, nodes, change, film)["left/image_raw"][0]).astype(np.int64)


def is_red(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    return picture[..., 0] > picture[..., 1] + 20


def test_a_cut_opens_red_and_what_is_beside_it_stays(gl: str, cut_block: CutBlock) -> None:
    first = nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    with make() as endoscope, make() as uncut:
        configure(endoscope, "liver/surface")
        configure(uncut)
        before = shoot(endoscope, first, cut_block.surface.change("liver", 0))
        # a body that may change looks as one that may not
        assert np.array_equal(before, shoot(uncut, first, None))
        assert not is_red(before).any()
        cut_block.cut(0.012)
        after = shoot(endoscope, nodes_of(cut_block.part(0.01)), cut_block.surface.change("liver", PERIOD_NS))
    red = is_red(after)
    height, width = red.shape
    assert red.sum() > 0.01 * red.size
    columns = np.flatnonzero(red.any(axis=0))
    assert 0.3 * width < columns.min() < columns.max() < 0.7 * width
    beside = after[height // 2, width // 4]
    assert np.abs(beside - before[height // 2, width // 4]).max() <= 2


@pytest.mark.parametrize(("kind", "bright"), [(FaceKind.COAGULATED, True), (FaceKind.CHARRED, False)])
def test_burnt_tissue_is_pale_or_black(gl: str, cut_block: CutBlock, kind: FaceKind, bright: bool) -> None:
    surface, first = cut_block.surface, nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    with make() as endoscope:
        configure(endoscope, "liver/surface")
        before = shoot(endoscope, first, surface.change("liver", 0))
        top = np.flatnonzero(cut_block.mesh.nodes[cut_block.mesh.triangles][..., 2].min(axis=1) > -1e-6)
        surface.replace(top, surface.faces[top], np.full(len(top), kind))
        after = shoot(endoscope, first, surface.change("liver", PERIOD_NS))
    middle = after.shape[0] // 2, after.shape[1] // 3
    assert bool(after[middle].sum() > before[middle].sum()) is bright
    assert np.ptp(after[middle]) < 0.5 * np.ptp(before[middle])  # neither is as green


def test_tissue_that_has_gone_is_not_drawn(gl: str, cut_block: CutBlock) -> None:
    surface, first = cut_block.surface, nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    with make() as endoscope:
        configure(endoscope, "liver/surface")
        whole = shoot(endoscope, first, surface.change("liver", 0))
        surface.remove(np.arange(len(surface.faces)))
        gone = shoot(endoscope, first, surface.change("liver", PERIOD_NS))
    green = whole[..., 1] > whole[..., 0] + 20
    assert green.any()
    assert not (gone[..., 1] > gone[..., 0] + 20).any()


def test_a_restored_scene_draws_the_cut(gl: str, cut_block: CutBlock) -> None:
    with make() as one, make() as other:
        for endoscope in (one, other):
            configure(endoscope, "liver/surface")
        step(one, nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles), None)
        unchanged = one.save()
        cut_block.cut(0.012)
        change = cut_block.surface.change("liver", PERIOD_NS)
        step(one, nodes_of(cut_block.part(0.01)), change)
        assert one.save() != unchanged
        other.restore(one.save())
        assert other.state_hash() == one.state_hash()
        moved = nodes_of(cut_block.part(0.011))
        assert np.array_equal(shoot(other, moved, change), shoot(one, moved, change))
        other.restore(unchanged)
        assert other.save() == unchanged


def test_it_keeps_the_contract_of_an_engine(gl: str, cut_block: CutBlock) -> None:
    first = nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    check_engine(
        make, period_ns=PERIOD_NS, inputs={"qpos": build(make().params).qpos0.copy(), "liver/nodes": first}
    )


def test_nodes_appended_for_an_unknown_change_are_not_drawn(gl: str, cut_block: CutBlock) -> None:
    """The scenario has no connection of the surface."""
    first = nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    with make() as endoscope:
        configure(endoscope)
        before = shoot(endoscope, first, None)
        cut_block.cut(0.012)
        more = nodes_of(cut_block.part(0.0))
        assert np.array_equal(shoot(endoscope, more, cut_block.surface.change("liver", 0)), before)


def test_a_strangers_change_is_refused(cut_block: CutBlock) -> None:
    body = SoftBody("liver/nodes", may_change=True)
    body.accept(nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles))
    cut_block.cut(0.012)
    change = cut_block.surface.change("liver", 0)
    with pytest.raises(SessionError, match=r"input 'liver/nodes': .* nodes, but .* before"):
        body.accept(nodes_of(cut_block.mesh.nodes), change)
    damaged = change.model_copy(update={"version": 99, "faces": change.faces + 10_000})
    with pytest.raises(SessionError, match=r"input 'liver/nodes': changed surface of 'liver', version 99"):
        body.accept(nodes_of(cut_block.part(0.0)), damaged)


def test_an_edge_between_two_kinds_is_sharp_and_the_room_is_kept() -> None:
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    one = SkinMesh(nodes, triangles, np.array([0, 0], np.uint8), most=8)
    two = SkinMesh(nodes, triangles, np.array([0, 1], np.uint8), most=8)
    assert len(one.faces) == len(two.faces) == 8
    assert len(two.vertices(nodes)) == len(one.vertices(nodes)) + 3  # two corners and a middle
    assert len(SkinMesh(nodes, triangles, most=7).faces) == 2


def test_a_larger_scene_keeps_the_room_for_new_faces(gl: str, cut_block: CutBlock) -> None:
    """MuJoCo allocates by the present counts, which are those of the surface drawn last."""
    with make() as endoscope:
        configure(endoscope, "liver/surface")
        step(endoscope, nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles), None)
        assert endoscope._scene is not None
        renderer = endoscope._scene._renderer
        room = renderer._scene.flexfacenum.copy()
        assert room[0] >= 24_000
        assert np.array_equal(renderer._new_scene(1000).flexfacenum, room)


def film_of(steps: NDArray[np.integer[Any]]) -> SurfaceFilm:
    nodes = np.flatnonzero(steps)
    return SurfaceFilm(
        header=Header(),
        body="liver",
        liquid="blood",
        nodes=nodes.astype(np.uint32),
        thickness=steps[nodes].astype(np.uint8),
    )


def test_thin_blood_is_red_thick_blood_is_dark_and_dry_tissue_is_as_before(
    gl: str, cut_block: CutBlock
) -> None:
    first = nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    x = cut_block.mesh.nodes[:, 0]
    with make() as wet, make() as dry:
        configure(wet, "liver/surface", "liver/film")
        configure(dry, "liver/surface")
        cut_block.cut(0.012)
        change = cut_block.surface.change("liver", 0)
        parted = nodes_of(cut_block.part(0.001))
        nothing = film_of(np.zeros(len(x), np.int64))
        step(wet, first, None, nothing)
        step(dry, first, None)
        without = shoot(dry, parted, change)
        assert np.abs(shoot(wet, parted, change, nothing) - without).max() <= 3
        steps = np.where(x < -0.015, 12, np.where(x > 0.015, 200, 0))
        picture = shoot(wet, parted, change, film_of(steps))
    height, width = picture.shape[:2]
    thin, thick = picture[height // 2, width // 5], picture[height // 2, 4 * width // 5]
    green = without[height // 2, width // 5]
    assert thin[1] < 0.5 * green[1]  # the tissue is green
    assert thick.sum() < thin.sum()
    assert thick[0] > 2 * thick[1]
    dry = height // 2, 9 * width // 20  # a film ends where its next node is dry, here 10 mm from the middle
    assert np.abs(picture[dry] - without[dry]).max() <= 8


def test_a_wet_body_is_saved_and_restored(gl: str, cut_block: CutBlock) -> None:
    cut_block.cut(0.012)
    first = nodes_of(cut_block.mesh.nodes, cut_block.mesh.triangles)
    parted, change = nodes_of(cut_block.part(0.001)), cut_block.surface.change("liver", 0)
    steps = np.arange(len(cut_block.part(0.0))) % 256
    body, other = (SoftBody("liver/nodes", may_change=True, may_be_wet=True) for _ in range(2))
    body.accept(first)
    body.accept(parted, change, film_of(steps))
    assert other.restore(body.save() + b"rest") == b"rest"
    assert np.array_equal(other.film, steps)
    assert other.save() == body.save()
    with pytest.raises(SessionError, match="allowed are"):
        body.accept(parted, change, film_of(np.ones(5000, np.int64)))
