"""The motion controller with the arms as MuJoCo moves them."""

import numpy as np
import pytest

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from hub.testing import Driver
from robots import rotation
from robots.dvrk import arms, cart
from robots.dvrk.arm_bodies import ENDOSCOPE_MASS
from robots.dvrk.dynamics import STANDARD_GRAVITY
from robots.dvrk.setup_joints import SIMULATED
from schemas.crtk import StringStamped
from schemas.ros import BoolMessage
from tests.controllers.motion.rig import EMPTY, HOME, H, ci, cp, jf, jp

pytest.importorskip("mujoco")

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams

CHAIN = arms.chain("PSM1")


ONE = {"PSM1": {"instrument": "400006"}}
SEVERAL = {
    "PSM1": {"instrument": "400006"},
    "PSM2": {"instrument": "400049"},
    "ECM": {"start": [0.2, 0.3, 0.1, 0.1]},
}


class Bench:
    """Controller and engine, stepped one after the other."""

    def __init__(self, arms=ONE, mounting="free"):
        scene = {"arms": arms, "mounting": mounting}
        self.robot = MujocoEngine("robot", MujocoParams.model_validate({**scene, "looks": False}))
        self.motion = MotionController(
            "motion", MotionParams.model_validate({**scene, "initial_state": "homed"})
        )
        self.arms, self.controller = Driver(self.robot, period_ns=H), Driver(self.motion, period_ns=H)
        self.complaints = []

    sensed = property(lambda self: self.arms.outputs)
    told = property(lambda self: self.controller.outputs)

    def step(self, count=1, **orders):
        """Step; orders of the first step by port, `__` for `/`; PSM1's unless they name an arm.

        Return PSM1's positions.
        """
        for name, order in orders.items():
            port = name if name.startswith(("PSM", "ECM")) else f"PSM1/{name}"
            self.controller.send(port.replace("__", "/"), order)
        for _ in range(count):
            for name in self.controller.values:
                self.controller.set(name, self.sensed[name.removeprefix("sense/")])
            self.controller.step()
            self.complaints += [
                said.data
                for name, heard in self.controller.sent.items()
                if name.endswith(("/error", "/warning"))
                for said in heard
            ]
            for name in self.arms.values:
                if (port := f"drive/{name}") in self.told:  # gravity keeps its start value
                    self.arms.set(name, self.told[port])
            self.arms.step()
        return self.position("PSM1") if "PSM1/measured_js" in self.sensed else None

    def position(self, arm):
        joints = self.sensed[f"{arm}/measured_js"]
        return joints[: joints.size // 3].copy()

    def tip(self, arm):
        return arms.chain(arm).forward(self.position(arm))[:3, 3]

    def push(self, body, force):
        """Push a body at its centre of mass, N in the world, from now on."""
        self.robot._data.xfrc_applied[self.robot._model.body(body).id, :3] = force


def test_move_jp_ends_within_a_tenth_of_a_millimetre_and_of_a_degree():
    bench, goal = Bench(), HOME + np.array([0.4, -0.3, 0.05, 0.6, 0.4, -0.5])
    bench.step(move_jp=jp(*goal))
    for _ in range(2500):
        measured = bench.step()
    one, other = CHAIN.forward(measured), CHAIN.forward(goal)
    turn = rotation.log(
        rotation.product(rotation.from_matrix(one), rotation.conjugate(rotation.from_matrix(other)))
    )
    assert not bench.complaints
    assert np.linalg.norm(one[:3, 3] - other[:3, 3]) < 1e-4
    assert np.degrees(np.linalg.norm(turn)) < 0.1


@pytest.mark.long
def test_servo_cp_tracks_a_circle_of_40_mm_at_a_quarter_of_a_hertz_within_a_millimetre():
    bench, errors = Bench(), []
    start = CHAIN.forward(HOME)
    orientation = rotation.from_matrix(start)
    for k in range(5000):
        angle = 2 * np.pi * 0.25 * k * H * 1e-9
        goal = start[:3, 3] + 0.02 * np.array([np.sin(angle), 1 - np.cos(angle), 0.0])
        measured = bench.step(servo_cp=cp([*goal, *orientation], "PSM1_base"))
        errors.append(np.linalg.norm(CHAIN.forward(measured)[:3, 3] - goal))
    assert not bench.complaints
    assert np.sqrt(np.mean(np.square(errors[1000:]))) < 1e-3


def test_several_arms_work_at_once():
    bench = Bench(SEVERAL, "cart")
    goals = {
        "PSM1": np.array([0.3, -0.2, 0.16, 0.5, 0.3, -0.4]),
        "PSM2": np.array([-0.3, 0.1, 0.09, -0.5, -0.2, 0.3]),
        "ECM": np.array([0.1, 0.2, 0.14, -0.2]),
    }
    bench.step(50)
    bench.step(3000, **{f"{arm}__move_jp": jp(*goal) for arm, goal in goals.items()})
    assert not bench.complaints
    for arm, goal in goals.items():
        assert np.allclose(bench.position(arm), goal, rtol=0.0, atol=np.radians(0.1)), arm
        assert np.linalg.norm(bench.tip(arm) - arms.chain(arm).forward(goal)[:3, 3]) < 1e-4, arm
    seen = bench.told["PSM2/measured_cp"][:3]
    camera = cart.camera_pose(arms.chain("ECM").forward(bench.position("ECM")), np.array(SIMULATED["ECM"]))
    base = cart.base_in_view("PSM2", np.array(SIMULATED["PSM2"]), camera)
    assert np.allclose(seen, base[:3, :3] @ bench.tip("PSM2") + base[:3, 3], rtol=0.0, atol=1e-4)


@pytest.mark.parametrize(
    ("arm", "body", "force", "drift"),
    [("PSM1", "PSM1/insertion", 6.0, 5e-4), ("ECM", "ECM/roll", 150.0, 1e-9)],
)
def test_an_arm_that_is_free_is_held_against_gravity_gives_way_to_a_push_and_stays_where_it_is_held(
    arm, body, force, drift
):
    bench = Bench(SEVERAL, "cart")
    bench.step(100)
    there = bench.tip(arm)
    bench.step(1000, **{f"{arm}__free": EMPTY})
    assert bench.told[f"drive/{arm}/control_mode"][0] == 2
    assert np.linalg.norm(bench.tip(arm) - there) < drift
    there = bench.tip(arm)
    bench.push(body, [force, 0.0, 0.0])
    bench.step(500)
    pushed = np.linalg.norm(bench.tip(arm) - there)
    assert pushed > 0.02
    bench.push(body, [0.0, 0.0, 0.0])
    bench.step(1000, **{f"{arm}__hold": EMPTY})
    held = bench.tip(arm)
    bench.step(500)
    assert np.linalg.norm(bench.tip(arm) - held) < 1e-4
    assert np.linalg.norm(held - there) > 0.01
    assert not bench.complaints


def test_a_tip_is_held_by_the_springs_of_an_impedance_and_comes_back():
    bench, k = Bench(), 400.0
    bench.step(200)
    here = bench.told["PSM1/local/measured_cp"].copy()
    sides = {f"position_{side}": {"p": (-k, -k, -k), "d": (-8, -8, -8)} for side in ("positive", "negative")}
    sides |= {
        f"orientation_{side}": {"p": (-0.3, -0.3, -0.3), "d": (-0.005, -0.005, -0.005)}
        for side in ("positive", "negative")
    }
    bench.step(1000, servo_ci=ci(here, **sides))
    rest = bench.tip("PSM1")
    bench.push("PSM1/wrist_yaw", [4.0, 0.0, 0.0])
    bench.step(1000)
    pushed = bench.tip("PSM1") - rest
    bench.push("PSM1/wrist_yaw", [0.0, 0.0, 0.0])
    bench.step(1000)
    assert np.linalg.norm(rest - here[:3]) < 2e-3  # the springs of the arm against those of the impedance
    assert 0.6 * 4.0 / k < pushed[0] < 1.1 * 4.0 / k  # dry friction bears the rest
    assert np.linalg.norm(bench.tip("PSM1") - rest) < 0.4 * pushed[0]
    assert not bench.complaints


def test_an_arm_without_torque_sinks_where_a_free_one_does_not():
    moved = {}
    for name, order in {
        "disable": {"state_command": StringStamped(string="disable")},
        "free": {"free": EMPTY},
    }.items():
        bench = Bench()
        bench.step(50)
        there = bench.position("PSM1")
        moved[name] = np.abs(bench.step(1000, **order) - there)[2]
    assert moved["free"] < 1e-6
    assert moved["disable"] > 2e-3


def test_efforts_come_on_top_of_gravity_compensation():
    bench = Bench()
    there = bench.step(50)
    bench.step(300, servo_jf=jf(1.0, 0, 0, 0, 0, 0))
    moved = bench.position("PSM1") - there
    assert moved[0] > 0.05
    assert np.abs(moved[1:3]).max() < 0.02


def test_gravity_compensation_of_the_endoscope_can_be_switched_off_and_on():
    def insertion_after(count, **orders):
        bench.step(count, **orders)
        return bench.position("ECM")[2]

    bench = Bench(SEVERAL, "cart")
    there = insertion_after(500)
    sagged = insertion_after(500, ECM__use_gravity_compensation=BoolMessage(data=False))
    assert bench.told["drive/ECM/control_mode"][0] == 3
    assert 5e-4 < sagged - there < 1.5 * ENDOSCOPE_MASS["Classic_SD"] * STANDARD_GRAVITY / 10_000.0
    # friction lets it back slowly
    assert insertion_after(500, ECM__use_gravity_compensation=BoolMessage(data=True)) == pytest.approx(
        there, abs=2e-4
    )
    there = insertion_after(300, ECM__free=EMPTY)
    assert insertion_after(500, ECM__use_gravity_compensation=BoolMessage(data=False)) - there > 5e-3
    assert not bench.complaints


def test_a_psm_has_no_gravity_compensation_to_switch_off():
    bench, twin = Bench(), Bench()
    bench.step(200, use_gravity_compensation=BoolMessage(data=False))
    twin.step(200)
    assert (bench.position("PSM1") == twin.position("PSM1")).all()
