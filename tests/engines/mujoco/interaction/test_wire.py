"""The bond at a needle: its points, the mass behind them, and who feels what is done to it."""

import mujoco
import numpy as np
import pytest

from engines.mujoco import model
from engines.mujoco.interaction.rigid_contact import RigidContact
from engines.mujoco.interaction.wire_bond import WireBond
from engines.mujoco.params import MujocoParams
from engines.mujoco.ports import bond_sides
from hub.participant import BondPlan, Inputs, MotionSide
from robots import rotation
from robots.training.needles import NEEDLES

PLAN = BondPlan(prediction="velocity", mean=True)
TURN = rotation.exp(np.array([0.3, -0.5, 0.8]))


@pytest.fixture(scope="module")
def scene():
    thing = {"kind": "needle", "needle": "src", "position": [0.0, 0.0, 0.3], "orientation": TURN.tolist()}
    params = MujocoParams.model_validate(
        {"arms": {"PSM1": {"position": [0.3, 0, 0.3]}}, "objects": {"needle": thing}, "looks": False}
    )
    built = model.build(params)
    data = mujoco.MjData(built)
    model.place(built, data, params.arms)
    mujoco.mj_forward(built, data)
    return params, built, data


def wire(scene):
    params, built, data = scene
    side = next(one for one in bond_sides(params) if one.name == "needle/wire")
    return WireBond("needle", params.objects["needle"], MotionSide(side, PLAN), built, data)


def test_its_points_are_base_middle_and_tip_and_move_as_the_needle_does(scene):
    _, built, data = scene
    data.qvel[:] = 0.0
    speed = np.array([0.1, -0.2, 0.05, 1.0, 2.0, -3.0])
    data.qvel[int(built.joint("needle").dofadr[0]) :][:6] = speed
    out = wire(scene).outputs
    needle = NEEDLES["src"]
    arms = (needle.points(np.array([-1, 0, 1]) * needle.arc / 2)) @ rotation.matrix(TURN).T
    assert out["needle/wire/position"] == pytest.approx((arms + np.array([0, 0, 0.3])).ravel())
    spin = rotation.matrix(TURN) @ speed[3:]
    assert out["needle/wire/velocity"] == pytest.approx((speed[:3] + np.cross(spin, arms)).ravel())
    data.qvel[:] = 0.0


def test_forces_on_its_points_are_one_load_and_the_drag_lasts_as_long_as_they_do(scene):
    _, built, data = scene
    there, forces = wire(scene), np.arange(9.0) * 1e-3
    there.begin(Inputs({"needle/wire/force": forces}))
    body = built.body("needle").id
    points = there.outputs["needle/wire/position"].reshape(3, 3)
    moment = np.cross(points - data.xipos[body], forces.reshape(3, 3)).sum(axis=0)
    assert data.xfrc_applied[body] == pytest.approx([*forces.reshape(3, 3).sum(axis=0), *moment])
    first = int(built.joint("needle").dofadr[0])
    assert built.dof_damping[first] == 8.0
    there.end()
    assert there.wrench[3:] == pytest.approx(np.cross(points, forces.reshape(3, 3)).sum(axis=0))
    there.begin(Inputs({"needle/wire/force": np.zeros(9)}))
    assert not built.dof_damping[first : first + 6].any()


def test_the_drag_stands_for_mass_behind_its_points(scene):
    params, built, data = scene
    least = WireBond.least_mass("needle", params.objects["needle"], built, data)
    free = params.objects["needle"].model_copy(update={"drag": 0.0})
    assert 0.0 < WireBond.least_mass("needle", free, built, data) < 0.1 * least


def test_the_holder_has_it_as_tip_wrench_and_no_more_as_rigid_wrench(scene):
    _, built, data = scene
    rigid = RigidContact(built, data, ["PSM1"])
    rigid.outputs["PSM1/rigid_wrench"][:] = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    felt = np.zeros(6)
    rigid.give("PSM1", np.array([0.5, 0.0, -0.2, 0.0, 0.01, 0.0]), felt)
    assert np.linalg.norm(felt[:3]) == pytest.approx(np.hypot(0.5, 0.2))
    assert rigid.outputs["PSM1/rigid_wrench"] + felt == pytest.approx([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    rigid.outputs["PSM1/rigid_wrench"][:] = felt[:] = 0.0
    rigid.give("PSM1", np.ones(6), felt)
    assert not felt.any()
