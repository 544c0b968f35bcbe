"""A thread behind a needle: as long as it is, whole under tension, and no heavier than it is."""

import mujoco
import numpy as np
import pytest

from engines.mujoco import model
from engines.mujoco.params import MujocoParams
from engines.mujoco.ports import position_count

THREAD = {"length": 0.1}
NODES = 60
"""Degrees of freedom of the thread."""


@pytest.fixture
def scene():
    needle = {"kind": "needle", "position": [0.0, 0.0, 0.1], "thread": THREAD}
    params = MujocoParams.model_validate(
        {"arms": {"PSM1": {"position": [0.3, 0, 0.3]}}, "objects": {"needle": needle}, "looks": False}
    )
    built = model.build(params)
    data = mujoco.MjData(built)
    model.place(built, data, params.arms)
    return params, built, data


def lengths(data):
    return np.linalg.norm(np.diff(data.flexvert_xpos, axis=0), axis=1)


def test_it_is_straight_behind_the_base_at_first_and_its_positions_are_counted(scene):
    params, built, data = scene
    mujoco.mj_forward(built, data)
    assert built.nq == position_count(params)
    assert lengths(data) == pytest.approx(np.full(20, 5e-3), abs=1e-9)
    assert np.ptp(data.flexvert_xpos @ (data.flexvert_xpos[1] - data.flexvert_xpos[0])) > 4.9e-4


def test_a_tension_of_a_stitch_neither_stretches_nor_shakes_it(scene):
    _, built, data = scene
    built.dof_damping[-NODES // 2 :] = 20.0  # the far half is in tissue
    needle = int(built.joint("needle").dofadr[0])
    built.dof_damping[needle : needle + 6] = 2.0  # held, so that it does not swing
    built.opt.gravity[:] = 0.0
    body = built.body("needle").id
    mujoco.mj_forward(built, data)
    forward = data.flexvert_xpos[0] - data.flexvert_xpos[1]
    sideways = np.cross(forward, [0.0, 0.0, 1.0]) * 1e-3 / 5e-3
    data.qvel[-NODES // 2 - 12 : -NODES // 2 - 9] = sideways * 100.0  # it is plucked
    for _ in range(400):
        data.xfrc_applied[body, :3] = 0.3 * forward / 5e-3
        mujoco.mj_step(built, data)
    assert lengths(data) == pytest.approx(np.full(20, 5e-3), rel=0.02)
    assert np.abs(data.qvel[-NODES:]).max() < 0.2


def test_it_weighs_what_it_is(scene):
    params, built, data = scene
    thread = params.objects["needle"].thread
    mujoco.mj_forward(built, data)
    weight = -(data.qfrc_passive - data.qfrc_bias)[-NODES:][2::3].sum()
    assert weight == pytest.approx(20 * thread.true_mass * 9.81, rel=1e-6)
