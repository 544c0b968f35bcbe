"""Masters under CRTK's commands, as MuJoCo moves them."""

import numpy as np
import pytest

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from hub.testing import Driver
from robots import rotation
from robots.dvrk import mtm
from schemas.crtk import StringStamped
from schemas.ros import BoolMessage, EmptyMessage, JointState, Quaternion, Vector3, Wrench, WrenchStamped
from tests.controllers.motion.rig import H, cp, jp

pytest.importorskip("mujoco")

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams

START = [0.1, 0.3, -0.2, 0.3, 0.5, 0.1, 0.1]


class Masters:
    """Controller and engine of two masters, stepped one after the other."""

    def __init__(self, state="homed"):
        scene = {"arms": {"MTML": {"start": START}, "MTMR": {}}, "mounting": "cart"}
        self.engine = MujocoEngine("robot", MujocoParams.model_validate({**scene, "looks": "none"}))
        self.motion = MotionController(
            "motion",
            MotionParams.model_validate({**scene, "initial_state": state, "publish_period": "1 ms"}),
        )
        self.robot, self.controller = Driver(self.engine, period_ns=H), Driver(self.motion, period_ns=H)
        self.heard = {}

    outputs = property(lambda self: self.controller.outputs)

    def step(self, count=1, **orders):
        """Step; orders of the first step by port, `__` for `/`."""
        for name, order in orders.items():
            self.controller.send(name.replace("__", "/"), order)
        self.heard = {}
        for _ in range(count):
            for name in self.controller.values:
                self.controller.set(name, self.robot.outputs[name.removeprefix("sense/")])
            self.controller.step()
            for name, messages in self.controller.sent.items():
                self.heard[name] = (*self.heard.get(name, ()), *messages)
            for name in self.robot.values:
                if (port := f"drive/{name}") in self.outputs:
                    self.robot.set(name, self.outputs[port])
            self.robot.step()
        return self

    def said(self, port):
        return [getattr(message, "data", message) for message in self.heard.get(port, ())]

    def pose(self, arm):
        """Pose of the gripper as measured, in the viewer's frame."""
        return self.outputs[f"{arm}/measured_cp"].copy()

    def hold(self, arm, pose, grip=1.0):
        """Let a hand hold the gripper at a pose in the viewer's frame."""
        self.robot.set(f"{arm}/hand_cp", pose)
        self.robot.set(f"{arm}/hand_grip", [grip])


def push(x=0.0, y=0.0, z=0.0):
    return WrenchStamped(wrench=Wrench(force=Vector3(x=x, y=y, z=z)))


def turned(one, other):
    return float(np.linalg.norm(rotation.log(rotation.product(rotation.conjugate(one[3:]), other[3:]))))


def lock(pose):
    return Quaternion(**dict(zip("xyzw", pose[3:].tolist(), strict=True)))


def test_masters_hold_and_state_what_carries_them():
    masters = Masters().step(100)
    assert np.abs(masters.robot.outputs["MTML/measured_js"][:7] - START).max() < 1e-6
    base, chain = mtm.BASE["MTML"], mtm.chain("MTML")
    np.testing.assert_allclose(
        masters.pose("MTML")[:3], (base @ chain.forward(np.array(START)))[:3, 3], atol=1e-6
    )
    weight = masters.outputs["MTML/gravity_compensation/setpoint_js"]
    assert 0.9 < weight[1] < 1.3


@pytest.mark.long
@pytest.mark.parametrize("order", [{"MTML__free": EmptyMessage()}, {"MTML__body__servo_cf": WrenchStamped()}])
def test_a_free_master_stays_where_it_is(order):
    masters = Masters().step(1, **order).step(200)
    before = masters.pose("MTML")
    masters.step(1000)
    assert np.linalg.norm(masters.pose("MTML")[:3] - before[:3]) < 1e-3


def test_without_gravity_compensation_a_free_master_sinks():
    masters = Masters().step(
        1, MTMR__free=EmptyMessage(), MTMR__use_gravity_compensation=BoolMessage(data=False)
    )
    before = masters.robot.outputs["MTMR/measured_cp"].copy()
    masters.step(400)
    assert masters.outputs["drive/MTMR/control_mode"].tolist() == [4.0, 1.0]
    assert masters.robot.outputs["MTMR/measured_cp"][2] < before[2] - 0.02


def test_a_wrench_moves_a_free_master_along_the_axes_of_the_viewer():
    masters = Masters().step(1, MTML__body__set_cf_orientation_absolute=BoolMessage(data=True))
    before = masters.pose("MTML")
    masters.step(300, MTML__body__servo_cf=push(x=1.0))
    way = masters.pose("MTML")[:3] - before[:3]
    assert way[0] > 0.01
    assert np.abs(way[1:]).max() < 0.5 * way[0]


def test_a_locked_orientation_is_kept_while_the_master_moves():
    masters = Masters().step(10)
    before = masters.pose("MTML")
    masters.step(
        400,
        MTML__body__set_cf_orientation_absolute=BoolMessage(data=True),
        MTML__lock_orientation=lock(before),
        MTML__body__servo_cf=push(x=-1.0),
    )
    assert masters.said("MTML/orientation_locked") == [True]
    assert masters.outputs["drive/MTML/control_mode"].tolist() == [5.0, 1.0]
    assert np.linalg.norm(masters.pose("MTML")[:3] - before[:3]) > 0.02
    assert turned(before, masters.pose("MTML")) < np.radians(2.0)
    masters.step(5, MTML__unlock_orientation=EmptyMessage())
    assert masters.said("MTML/orientation_locked") == [False]
    assert masters.outputs["drive/MTML/control_mode"].tolist() == [2.0, 1.0]


def test_a_lock_that_is_no_rotation_is_refused():
    masters = Masters().step(1, MTML__lock_orientation=Quaternion(w=2.0))
    assert "norm 2" in masters.said("MTML/error")[0]
    assert masters.said("MTML/orientation_locked") == []


@pytest.mark.long
def test_move_cp_arrives():
    masters = Masters().step(10)
    goal = masters.pose("MTML")
    goal[:3] += 0.03, -0.02, 0.02
    masters.step(2500, MTML__move_cp=cp(goal))
    assert masters.said("MTML/goal_reached") == [True]
    assert np.linalg.norm(masters.pose("MTML")[:3] - goal[:3]) < 5e-4


def test_commands_while_not_homed_and_of_wrong_size_are_refused():
    masters = Masters("disabled").step(1, MTML__servo_jp=jp(*START))
    assert "the arm is DISABLED" in masters.said("MTML/warning")[0]
    masters = Masters().step(1, MTML__servo_jp=jp(0.0, 0.0))
    assert "2 values of position, expected 7" in masters.said("MTML/error")[0]
    nan = JointState.model_construct(**{**dict(jp(*START)), "position": np.full(7, np.nan)})
    masters.step(1, MTML__servo_jp=nan)
    assert "finite" in masters.said("MTML/error")[0]


def test_a_master_led_by_a_program_that_dies_stays_at_its_last_goal():
    masters = Masters().step(10)
    goal = masters.pose("MTML")
    for _ in range(20):
        goal[0] += 5e-4
        masters.step(5, MTML__servo_cp=cp(goal))
    masters.step(300)
    assert np.linalg.norm(masters.pose("MTML")[:3] - goal[:3]) < 5e-4
    assert masters.outputs["drive/MTML/control_mode"].tolist() == [1.0, 1.0]
    assert masters.said("MTML/error") == masters.said("MTML/warning") == []


def test_a_wrench_of_a_program_that_dies_stays_until_hold():
    masters = Masters().step(1, MTML__body__servo_cf=WrenchStamped())
    masters.step(500, MTML__body__servo_cf=push(z=0.5))
    effort = masters.outputs["drive/MTML/servo_jf"].copy()
    assert np.abs(effort[:3]).max() > 0.02
    masters.step(400, MTML__hold=EmptyMessage())
    assert masters.outputs["drive/MTML/control_mode"].tolist() == [1.0, 1.0]
    before = masters.pose("MTML")
    masters.step(100)
    assert np.linalg.norm(masters.pose("MTML")[:3] - before[:3]) < 1e-4


@pytest.mark.long
def test_home_goes_to_zero():
    masters = Masters("disabled").step(1, MTMR__state_command=StringStamped(string="home"))
    masters.step(3000)
    assert np.abs(masters.robot.outputs["MTMR/measured_js"][:7]).max() < np.radians(1.0)


@pytest.mark.long
def test_a_hand_moves_a_free_master_and_feels_what_is_commanded_to_it():
    masters = Masters().step(1, MTML__body__servo_cf=WrenchStamped())
    goal = masters.pose("MTML")
    goal[0] += 0.02
    masters.hold("MTML", goal)
    masters.step(1500)
    assert np.linalg.norm(masters.pose("MTML")[:3] - goal[:3]) < 1.5e-3  # dry friction over stiffness
    before = masters.robot.outputs["MTML/hand_cf"].copy()
    masters.step(
        1500,
        MTML__body__set_cf_orientation_absolute=BoolMessage(data=True),
        MTML__body__servo_cf=push(x=2.0),
    )
    felt = masters.robot.outputs["MTML/hand_cf"] - before
    assert 1.5 < felt[0] < 2.6
    assert np.abs(felt[1:3]).max() < 0.5


@pytest.mark.long
def test_a_hand_that_lets_go_leaves_the_master_hanging():
    masters = Masters().step(1, MTML__body__servo_cf=WrenchStamped())
    masters.hold("MTML", masters.pose("MTML"))
    masters.step(200)
    masters.hold("MTML", masters.pose("MTML"), grip=0.0)
    masters.step(300)
    before = masters.pose("MTML")
    masters.step(1000)
    assert np.linalg.norm(masters.pose("MTML")[:3] - before[:3]) < 1e-3
    assert np.abs(masters.robot.outputs["MTML/hand_cf"]).max() == 0.0


def test_the_gripper_says_when_it_is_closed():
    masters = Masters()
    masters.robot.set("MTML/gripper/servo_jp", [0.0])
    masters.step(600)
    assert masters.said("MTML/gripper/closed") == [True]
    assert len(masters.heard["MTML/gripper/pinch"]) == 1
    masters.robot.set("MTML/gripper/servo_jp", [0.8])
    masters.step(600)
    assert masters.said("MTML/gripper/closed") == [False]
    assert masters.outputs["MTML/gripper/measured_js"][0] == pytest.approx(0.8, abs=1e-2)


def test_a_restored_session_goes_on_to_the_bit():
    masters = Masters().step(1, MTML__body__servo_cf=WrenchStamped())
    masters.hold("MTML", masters.pose("MTML"), grip=0.7)
    masters.step(50)
    saved = masters.motion.save(), masters.engine.save()
    masters.step(50)
    first = masters.motion.state_hash(), masters.engine.state_hash()
    masters.motion.restore(saved[0])
    masters.engine.restore(saved[1])
    masters.robot.outputs.update(masters.engine._outputs)
    masters.step(50)
    assert (masters.motion.state_hash(), masters.engine.state_hash()) == first
