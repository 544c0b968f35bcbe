"""A joint driven through a bond: nothing else drives or brakes it."""

from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import BondPlan, Inputs, Setup
from hub.testing import check_engine
from robots.dvrk import dynamics
from robots.dvrk.instruments import instrument
from schemas.errors import ScenarioError

PERIOD_NS = 500_000
IMPULSE = BondPlan(prediction="velocity", mean=True)


def make(*joints, **params):
    scene = {"arms": {"PSM1": {"instrument": "400006"}}, "looks": False, "rigid_wrench": False}
    bonded = {"bonded_joints": {"PSM1": joints or ("insertion",)}}
    return MujocoEngine("robot", MujocoParams.model_validate(scene | bonded | params))


def stepped(engine, steps, bond, **given):
    setup = Setup(PERIOD_NS, Path(), {bond: IMPULSE})
    before = {name: np.copy(value) for name, value in engine.configure(setup).items()}
    inputs = {port.name: np.array(port.start, float) for port in engine.ports if port.start is not None}
    inputs |= {name: np.array(value) for name, value in given.items()}
    outputs = {}
    for i in range(steps):
        outputs = engine.step(i * PERIOD_NS, PERIOD_NS, Inputs(dict(inputs)))
    return before, outputs


@pytest.mark.parametrize(("joint", "force"), [("insertion", 2.0), ("yaw", 0.5)])
def test_it_keeps_the_contract(joint, force):
    check_engine(lambda: make(joint), period_ns=PERIOD_NS, inputs={f"PSM1/{joint}/force": [force]})


def test_a_force_accelerates_the_mass_alone():
    engine = make()
    before, after = stepped(engine, 40, "PSM1/insertion", **{"PSM1/insertion/force": [2.0]})
    q = before["PSM1/measured_js"][:6]
    mass = 1.0 / np.linalg.inv(dynamics.of_psm(instrument("400006")).inertia_matrix(q))[2, 2]
    assert engine.bonds[-1].effective_mass == pytest.approx(mass, rel=1e-3)
    assert engine.bonds[-1].coordinate == "length"
    gained = 2.0 * 40 * PERIOD_NS * 1e-9 / mass
    assert after["PSM1/insertion/velocity"][0] == pytest.approx(gained, rel=0.02)
    assert after["PSM1/measured_js"][14] == 2.0
    moved = after["PSM1/insertion/position"] - before["PSM1/insertion/position"]
    assert after["PSM1/insertion/work"] == pytest.approx(-2.0 * moved)
    engine.close()


def test_the_goal_is_the_command_no_faster_than_the_joint_may_move():
    engine = make()
    command = [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]
    still = {"PSM1/insertion/force": [0.0], "PSM1/servo_jp": command}
    before, after = stepped(engine, 20, "PSM1/insertion", **still)
    assert before["PSM1/insertion/goal"][0] == pytest.approx(0.12)
    fastest = engine.params.arms["PSM1"].chain.joints[2].velocity
    assert after["PSM1/insertion/goal"][0] == pytest.approx(0.12 + 20 * fastest * PERIOD_NS * 1e-9)
    assert after["PSM1/insertion/position"][0] == pytest.approx(0.12, abs=1e-4)
    engine.close()


def test_a_joint_without_a_drive_is_refused():
    with pytest.raises(
        ScenarioError, match=r"joint 'PSM1/insertion' has no drive: bond 'robot.PSM1/insertion'"
    ):
        make().configure(Setup(PERIOD_NS, Path(), {}))


@pytest.mark.parametrize(
    ("params", "text"),
    [
        (
            {"bonded_joints": {"PSM1": ["insertoin"]}},
            "no joint 'insertoin' of PSM1. Did you mean 'insertion'",
        ),
        ({"bonded_joints": {"PSM2": ["yaw"]}}, "no joint 'yaw' of PSM2"),
        (
            {"arms": {"PSM1": {"instrument": "400006", "spares": ["400049"]}}},
            "bonded_joints: not beside `spares`, as PSM1 has them",
        ),
    ],
)
def test_joints_are_the_arms_own(params, text):
    with pytest.raises(ValueError, match=text):
        make(**params)
