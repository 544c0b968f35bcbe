"""A needle rolled between the pads of a jaw, by nothing but friction."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from controllers.routine import Routine, RoutineParams
from engines.mujoco import model
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from engines.mujoco.ports import position_count
from hub.participant import Inputs, Setup
from hub.testing import run_in_process
from robots import rotation
from robots.dvrk import held_needle, psm
from robots.dvrk.end_effectors.rolling_jaw import PADS
from robots.dvrk.held_needle import Needle
from robots.dvrk.instruments import instrument

TOOL, NEEDLE = instrument("ROLLING_NEEDLE_DRIVER"), Needle()
START = np.array(psm.HOME)
MS = 10**6
# rad: the wire sinks 20 um into the pads, which are hard but not rigid, so it rolls as one that is 5 %
# thinner, of a quarter turn each way
ROLLED_BY = 0.13


def held(hold):
    return held_needle.chain(TOOL, NEEDLE, hold * NEEDLE.arc)


def scene(hold=0.5, **more):
    """The needle between the pads, which all but touch it."""
    pose = held(hold).forward(np.append(START, 0.0))
    touching = 2.0 * np.arcsin(TOOL.jaw.wire_radius / TOOL.jaw.distance)
    needle = {
        "kind": "needle",
        "position": pose[:3, 3].round(12).tolist(),  # a length below 1 nm is refused
        "orientation": rotation.from_matrix(pose).tolist(),
    }
    arm = {"instrument": TOOL.name, "start": START.tolist(), "jaw": float(touching) - 1e-3}
    return MujocoParams.model_validate(
        {
            "arms": {"PSM1": arm},
            "objects": {"needle": needle},
            "looks": False,
            "publish_period": "1 ms",
            **more,
        }
    )


class Rig:
    def __init__(self, params):
        self.engine = MujocoEngine("robot", params)
        self.inputs = {
            port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"
        }
        self.outputs = self.engine.configure(Setup(period_ns=MS, directory=Path()))
        self.t = 0

    def run(self, seconds, jaw, roll):
        begin = self.inputs["PSM1/jaw/servo_jp"][1]
        steps = round(seconds * 1000)
        for i in range(steps):
            self.inputs["PSM1/jaw/servo_jp"][:] = jaw, begin + (roll - begin) * (i + 1) / steps
            self.outputs = self.engine.step(self.t, MS, Inputs(self.inputs))
            self.t += MS

    def needle(self):
        pose = self.outputs["needle/pose"]
        return pose[:3], rotation.matrix(pose[3:])


@pytest.mark.parametrize("hold", [0.5, 2 / 3, 5 / 6])
def test_the_pads_roll_the_needle_to_where_the_kinematics_have_it(hold):
    rig = Rig(scene(hold))
    rig.run(0.3, np.radians(-20.0), 0.0)
    assert rig.outputs["needle/held_by"] == 1
    for roll in np.radians([-90.0, 90.0]):
        rig.run(1.0, np.radians(-20.0), roll)
        measured = rig.outputs["PSM1/jaw/measured_js"].reshape(3, 2)
        assert measured[0, 1] == pytest.approx(roll, abs=0.01)
        assert rig.outputs["needle/turn"][0] == pytest.approx(abs(roll), rel=0.1)
        position, turned = rig.needle()
        expected = held(hold).forward(np.append(START, roll))
        assert np.linalg.norm(position - expected[:3, 3]) < ROLLED_BY * NEEDLE.radius
        assert (np.trace(turned.T @ expected[:3, :3]) - 1) / 2 > np.cos(ROLLED_BY)
    assert rig.outputs["needle/slip"][0] < 2e-4


def test_the_jaw_has_two_positions_and_its_pads_go_opposite_ways():
    params = scene()
    ports = {port.name: port for port in MujocoEngine("robot", params).ports}
    assert ports["PSM1/jaw/servo_jp"].names == ports["PSM1/jaw/measured_js"].names == ("jaw", "roller")
    built = model.build(params)
    assert built.nq == position_count(params)
    data = mujoco.MjData(built)
    for pad in PADS:
        data.qpos[built.joint(f"PSM1/{pad}").qposadr[0]] = 1e-4
    before = mujoco.MjData(built)
    mujoco.mj_forward(built, before)
    mujoco.mj_forward(built, data)
    left, right = (data.body(f"PSM1/{pad}").xpos - before.body(f"PSM1/{pad}").xpos for pad in PADS)
    assert np.allclose(left, [0.0, 0.0, -1e-4])  # ahead, which is down at home
    assert np.allclose(right, [0.0, 0.0, 1e-4])


def test_twice_the_same_and_on_from_a_saved_state():
    one, other = Rig(scene()), Rig(scene())
    for rig in (one, other):
        rig.run(0.2, np.radians(-20.0), 0.3)
    assert one.engine.state_hash() == other.engine.state_hash()
    saved = one.engine.save()
    one.run(0.1, np.radians(-20.0), 0.6)
    late = Rig(scene())
    late.engine.restore(saved)
    late.t = 200 * MS
    late.inputs["PSM1/jaw/servo_jp"][:] = np.radians(-20.0), 0.3
    late.run(0.1, np.radians(-20.0), 0.6)
    assert late.engine.state_hash() == one.engine.state_hash()
    assert late.outputs["needle/turn"][0] == one.outputs["needle/turn"][0]


def test_a_weld_would_hold_what_is_to_roll():
    with pytest.raises(ValidationError, match="use grasp: friction"):
        scene(grasp="weld")


def test_a_routine_rolls_the_needle_through_the_motion_controller():
    params = scene()
    arms = {"PSM1": {"instrument": TOOL.name, "start": START.tolist(), "jaw": params.arms["PSM1"].jaw}}
    squeeze = {"do": "jaw", "arm": "PSM1", "angle": "-20 deg", "roll": 0.0}
    participants = {
        "routine": Routine(
            "routine",
            RoutineParams.model_validate(
                {"steps": [squeeze, {"do": "wait", "time": "150 ms"}, {**squeeze, "roll": "45 deg"}]}
            ),
        ),
        "motion": MotionController(
            "motion",
            MotionParams.model_validate(
                {"mounting": "free", "reference": "base", "initial_state": "homed", "arms": arms}
            ),
        ),
        "robot": MujocoEngine("robot", params),
    }
    scenario = {
        "name": "rolling",
        "step": "1 ms",
        "duration": "2 s",
        "order": ["routine", "motion", "robot"],
        "connections": [
            "routine.* -> motion.*",
            "motion.* -> routine.*",
            "motion.drive/* -> robot.*",
            "robot.* -> motion.sense/*",
        ],
        "measure": {
            "turn": {"kind": "final", "of": "robot.needle/turn"},
            "done": {"kind": "final", "of": "routine.done"},
        },
    }
    measured = run_in_process(scenario, participants).measures
    assert measured["done"] == 1
    assert measured["turn"] == pytest.approx(np.radians(45), rel=0.1)
