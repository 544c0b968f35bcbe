"""Exchange of instruments in the robot's model: mechanics, contacts, names in pictures and saved states."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from engines.mujoco import model
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.markers.frames import SceneFrames
from engines.mujoco.params import MujocoParams
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.ports import position_count
from engines.mujoco.truth.keypoints import instruments
from engines.mujoco.truth.labels import rigid_class
from engines.mujoco.truth.scene_class import SceneClass
from hub.participant import BondPlan, Inputs, Setup
from schemas.errors import SessionError

H = 1_000_000
START = [0.1, -0.05, 0.14, 0.2, 0.1, -0.1]
SPARES = ["400179", "400183"]
APPLIER = {"instrument": "400230", "start": START}
HOOK = {"instrument": "400183", "start": START}
WITH_SPARES = {**APPLIER, "spares": SPARES}
HOOK_BOND = "PSM1/PERMANENT_CAUTERY_HOOK_400183/contact"


class Robot:
    """An engine with its inputs, stepped by hand."""

    def __init__(self, arm, bonds=(), **scene):
        params = MujocoParams.model_validate({"arms": {"PSM1": arm}, "looks": "none", **scene})
        self.engine, self.t = MujocoEngine("robot", params), 0
        plans = dict.fromkeys(bonds, BondPlan("velocity", mean=True))
        self.outputs = self.engine.configure(Setup(period_ns=H, directory=Path(), bonds=plans))
        ports = [port for port in self.engine.ports if port.causality == "input" and port.start is not None]
        self.values = {port.name: np.array(port.start) for port in ports}
        self.values |= {
            f"{one.name}/force": np.zeros(one.size) for one in self.engine.bonds if one.name in bonds
        }

    def steps(self, count):
        for _ in range(count):
            self.outputs = self.engine.step(self.t, H, Inputs(self.values))
            self.t += H
        return self

    def give(self, number, count=1):
        self.values["PSM1/instrument"][:] = number
        return self.steps(count)

    def sway(self, count):
        for i in range(count):
            self.values["PSM1/servo_jp"][:] = START
            self.values["PSM1/servo_jp"][[0, 3]] += np.array([0.05, 0.1]) * np.sin(0.01 * i)
            self.steps(1)
        return self


def test_every_declared_output_is_there_and_qpos_has_the_size_of_the_port():
    robot = Robot(WITH_SPARES)
    declared = {port.name: port for port in robot.engine.ports if port.causality == "output"}
    assert not declared.keys() - robot.outputs.keys()
    assert robot.outputs["qpos"].size == position_count(robot.engine.params)


@pytest.mark.parametrize(("number", "alone"), [(0, APPLIER), (2, HOOK)])
def test_an_arm_with_spares_moves_as_an_arm_that_has_the_engaged_instrument_alone(number, alone):
    one, other = Robot(WITH_SPARES).give(number, 50).sway(400), Robot(alone).steps(50).sway(400)
    n = 6
    difference = one.outputs["PSM1/measured_js"][:n] - other.outputs["PSM1/measured_js"][:n]
    assert np.abs(difference).max() < 3e-6
    np.testing.assert_allclose(one.outputs["PSM1/measured_cp"], other.outputs["PSM1/measured_cp"], atol=3e-6)


def test_the_new_instrument_stands_where_the_servos_are_and_the_old_one_is_gone():
    robot = Robot(WITH_SPARES).steps(20).give(1)
    assert np.abs(robot.outputs["PSM1/measured_js"][:6] - START).max() < 1e-4
    data = robot.engine._data
    assert np.linalg.norm(data.body("PSM1/wrist_yaw").xpos) > 900.0
    assert np.linalg.norm(data.body("PSM1/MONOPOLAR_CURVED_SCISSORS_400179/wrist_yaw").xpos) < 0.2


def test_a_jawless_instrument_has_a_jaw_at_zero():
    robot = Robot({**APPLIER, "spares": ["400183"], "jaw": 0.3}).steps(20)
    assert robot.outputs["PSM1/jaw/measured_js"][0] == pytest.approx(0.3, abs=1e-3)
    assert not robot.give(1, 5).outputs["PSM1/jaw/measured_js"].any()
    assert robot.give(0, 20).outputs["PSM1/jaw/measured_js"][0] == pytest.approx(0.3, abs=1e-2)


def test_a_force_on_the_engaged_instrument_is_felt_and_others_feel_none():
    robot = Robot(WITH_SPARES, bonds=["PSM1/contact", HOOK_BOND]).give(2, 5)
    robot.values[f"{HOOK_BOND}/force"][:3] = [0.0, 0.5, 0.0]
    robot.steps(20)
    assert np.linalg.norm(robot.outputs["PSM1/tip_wrench"][:3]) == pytest.approx(0.5, rel=1e-6)
    masses = {side.name: side.effective_mass for side in robot.engine.bonds}
    (alone,) = Robot(HOOK).engine.bonds
    assert masses[HOOK_BOND] == pytest.approx(alone.effective_mass, rel=1e-3)


def test_what_was_held_falls():
    pick = {
        "objects": {"block": {"kind": "block", "position": [0.0, 0.0, -0.15], "size": [0.004, 0.02, 0.02]}},
        "table": {"position": [0.0, 0.0, -0.2]},
        "grasp": "weld",
    }
    robot = Robot({"instrument": "400006", "spares": ["400183"], "start": [0, 0, 0.14, 0, 0, 0]}, **pick)
    data, weld = robot.engine._data, robot.engine._model.equality("block/PSM1/weld").id
    data.eq_active[weld] = 1
    robot.give(1)
    assert not data.eq_active[weld]
    robot.steps(30)
    assert -0.2 < data.body("block").xpos[2] < -0.153


def test_saved_states_go_on_to_the_bit_over_an_exchange():
    robot = Robot(WITH_SPARES).sway(50)
    state = robot.engine.save()
    robot.give(2, 30)
    later, expected = robot.engine.save(), robot.give(0, 30).engine.state_hash()
    other = Robot(WITH_SPARES)
    other.engine.restore(state)
    other.t, other.values = 50 * H, {name: value.copy() for name, value in robot.values.items()}
    assert other.give(2, 30).give(0, 30).engine.state_hash() == expected
    other.engine.restore(later)
    other.t = 80 * H
    assert other.give(0, 30).engine.state_hash() == expected


def test_a_number_of_no_instrument_ends_the_session():
    with pytest.raises(SessionError, match="allowed are 0 to 2"):
        Robot(WITH_SPARES).give(3)


def test_frames_keypoints_and_classes_follow_the_positions_of_the_joints():
    params = EndoscopeParams.model_validate({"arms": {"PSM1": WITH_SPARES, "ECM": {}}})
    built = model.build(params)
    data = mujoco.MjData(built)
    model.place(built, data, params.arms)
    frames, found = SceneFrames(params, built), instruments(params, built)
    for number, name in enumerate(["LARGE_CLIP_APPLIER_400230", "MONOPOLAR_CURVED_SCISSORS_400179"]):
        robot = Robot(WITH_SPARES).give(number, 5)
        seats = [one.seat for one in robot.engine._exchange._instruments["PSM1"]]
        mine = [one.seat for one in found]
        data.qpos[mine] = robot.engine._data.qpos[seats]
        mujoco.mj_kinematics(built, data)
        assert [one.tool for one in found if one.is_in_arm(data)] == [name]
        assert np.linalg.norm(frames.pose("PSM1", data)[:3, 3]) < 1.0
    scissors = "PSM1/MONOPOLAR_CURVED_SCISSORS_400179"
    assert rigid_class(params, f"{scissors}/jaw_left") is SceneClass.JAW
    assert rigid_class(params, f"{scissors}/roll") is SceneClass.SHAFT
    assert rigid_class(params, "PSM1/PERMANENT_CAUTERY_HOOK_400183/wrist_yaw") is SceneClass.JAW
    assert rigid_class(params, "PSM1/seat") is SceneClass.ARM
