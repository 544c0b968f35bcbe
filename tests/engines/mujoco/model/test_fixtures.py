"""Boards, dishes, pieces and triangular rings in the model, and where things start."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from engines.mujoco.model import build
from engines.mujoco.model.objects import start_pose
from engines.mujoco.object_params import PieceParams, TriangleParams
from engines.mujoco.params import SceneParams
from robots import rotation
from robots.training.boards import BOARDS
from robots.training.dishes import DISH, PIECE
from robots.training.needles import NEEDLES
from robots.training.targets import DISC_HEIGHT, DISC_RADIUS, DISCS

ARM = {"PSM1": {"instrument": "400006", "position": [0, 0, 0.5]}}
TURNED = [0, 0, 1, 0]


def settled(seconds=0.3, **scene):
    model = build(SceneParams.model_validate({"arms": ARM, "looks": False, **scene}))
    data = mujoco.MjData(model)
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return model, data


@pytest.mark.parametrize("name", BOARDS)
def test_a_ring_comes_to_rest_around_its_post_at_its_height(name):
    board = BOARDS[name]
    x, y = -board.posts[board.starts[0]]  # of a board turned by 180 degrees
    ring = {"kind": "triangle", "ring": name, "position": [x, y, board.ring.height / 2 + 1e-3]}
    fixture = {"kind": "board", "board": name, "position": [0, 0, 0], "orientation": TURNED}
    model, data = settled(fixtures={"board": fixture}, objects={"ring1": ring})
    body = data.body("ring1")
    assert body.xpos == pytest.approx([x, y, board.ring.height / 2], abs=0.1e-3)
    assert body.xmat[8] == pytest.approx(1.0, abs=1e-3)
    assert model.body("ring1").mass == pytest.approx(board.ring.mass)
    posts = [data.body(f"board/post{i}").xpos[:2] for i in range(len(board.posts))]
    assert np.allclose(posts, -board.posts)


def test_the_corner_of_a_ring_is_on_y_and_its_hole_is_free():
    board = BOARDS["icra2026"]
    scene = SceneParams.model_validate(
        {
            "arms": ARM,
            "looks": False,
            "objects": {"ring1": {"kind": "triangle", "ring": "icra2026", "position": [0, 0, 0]}},
        }
    )
    model = build(scene)
    geoms = np.flatnonzero(model.geom_bodyid == model.body("ring1").id)
    balls = geoms[model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_SPHERE]
    highest = model.geom_pos[balls][model.geom_pos[balls, 1].argmax()]
    assert highest[0] == pytest.approx(0.0, abs=1e-9)
    boxes = geoms[model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_BOX]
    faces = np.linalg.norm(model.geom_pos[boxes, :2], axis=1) - model.geom_size[boxes, 0]
    assert (faces >= board.ring.inradius).all()


def test_a_piece_lies_in_a_dish_and_cannot_leave_it_sideways():
    dish = {"kind": "dish", "position": [0, 0, 0]}
    objects = {"piece1": {"kind": "piece", "position": [0, 0, PIECE.size[2] / 2]}}
    scene = {"table": {"position": [0, 0, 0]}, "fixtures": {"middle": dish}, "objects": objects}
    model, data = settled(**scene)
    assert data.body("piece1").xpos[2] == pytest.approx(PIECE.size[2] / 2, abs=0.05e-3)
    data.qvel[model.joint("piece1").dofadr[0]] = 0.3
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.body("piece1").xpos[:2]) < DISH.inner_radius
    assert model.body("piece1").mass == pytest.approx(PIECE.mass)


def test_a_fixture_and_an_object_have_different_names():
    with pytest.raises(ValidationError, match="middle: the name of an object and of a fixture"):
        SceneParams.model_validate(
            {
                "arms": ARM,
                "fixtures": {"middle": {"kind": "dish", "position": [0, 0, 0]}},
                "objects": {"middle": {"kind": "piece", "position": [0, 0, 0]}},
            }
        )


@given(
    st.integers(0, 10**6),
    st.just(0.0) | st.floats(1e-6, 5e-3),
    st.just(0.0) | st.floats(1e-6, 1.0),
)
def test_a_seed_moves_a_start_within_its_scatter_and_always_alike(seed, reach, turn):
    params = PieceParams(kind="piece", position=(0.1, 0.2, 0.3), scatter=(reach, 2 * reach, turn))
    position, quaternion = start_pose("piece1", params, seed)
    assert (np.abs(position - [0.1, 0.2, 0.3]) <= np.array([reach, 2 * reach, 0.0]) + 1e-15).all()
    assert np.linalg.norm(rotation.log(quaternion)) <= turn + 1e-12
    again = start_pose("piece1", params, seed)
    assert (again[0] == position).all()
    assert (again[1] == quaternion).all()


def test_seeds_and_names_differ_and_without_a_seed_nothing_moves():
    params = TriangleParams(kind="triangle", ring="fls", position=(0, 0, 0), scatter=(1e-3, 1e-3, 1.0))
    drawn = [
        tuple(np.concatenate(start_pose(name, params, seed)))
        for name in ("ring1", "ring2")
        for seed in range(50)
    ]
    assert len(set(drawn)) == len(drawn)
    spread = np.array(drawn)[:, :2].std(axis=0)
    assert spread == pytest.approx(1e-3 / np.sqrt(3), rel=0.25)  # of a uniform distribution
    assert start_pose("ring1", params, None)[0] == pytest.approx([0, 0, 0])


def test_a_box_has_four_discs_on_its_top():
    model, data = settled(0.0, fixtures={"box": {"kind": "disc-box", "position": [0.1, 0, 0.2]}})
    mujoco.mj_forward(model, data)
    discs = [i for i in range(model.ngeom) if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_CYLINDER]
    middles = data.geom_xpos[discs] - [0.1, 0, 0.2]
    assert np.allclose(middles[:, :2], DISCS)
    assert np.allclose(middles[:, 2] + model.geom_size[discs, 1], 0.0)
    assert np.allclose(model.geom_size[discs, 0], DISC_RADIUS)
    assert data.geom("box").xpos[2] + model.geom("box").size[2] == pytest.approx(0.2 - DISC_HEIGHT)


def test_a_marked_needle_is_seen_and_not_felt():
    plain, marked = (
        build(
            SceneParams.model_validate(
                {
                    "arms": ARM,
                    "looks": False,
                    "objects": {"needle": {"kind": "needle", "position": [0, 0, 0], "marked": marked}},
                }
            )
        )
        for marked in (False, True)
    )
    assert marked.ngeom == plain.ngeom + 1
    own = [i for i in range(marked.ngeom) if marked.geom_bodyid[i] == marked.body("needle").id]
    (ball,) = [i for i in own if marked.geom_rgba[i, 2] > 0.9]
    assert (marked.geom_contype[ball], marked.geom_conaffinity[ball]) == (0, 0)
    assert np.allclose(marked.geom_pos[ball], NEEDLES["sh-plus"].marks[2])
    assert np.allclose(marked.body("needle").inertia, plain.body("needle").inertia)
