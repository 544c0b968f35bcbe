from pathlib import Path

import mujoco
import numpy as np
import pytest
import yourdfpy
from pydantic import ValidationError

from engines.mujoco import looks
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.export import write
from engines.mujoco.model import build
from engines.mujoco.params import MujocoParams, SceneParams
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from robots.dvrk import arms
from robots.dvrk.end_effectors.musha import HAND, TROCAR_RADIUS

H = 1_000_000
SCENE = {"arms": {"PSM1": {"instrument": "MUSHA_HAND"}}, "looks": False}


class Run:
    """An engine with a hand, stepped by hand."""

    def __init__(self, **arm):
        self.engine = MujocoEngine(
            "robot",
            MujocoParams.model_validate({**SCENE, "arms": {"PSM1": {"instrument": "MUSHA_HAND", **arm}}}),
        )
        self.outputs = self.engine.configure(Setup(period_ns=H, directory=Path(), bonds={}))
        self.model, self.data = self.engine._model, self.engine._data
        self.values = {
            port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"
        }
        self.t = 0

    def go(self, closings, steps=1000):
        self.values["PSM1/hand/servo_jp"][:] = closings
        inputs = Inputs(self.values)
        for _ in range(steps):
            self.outputs = self.engine.step(self.t, H, inputs)
            self.t += H
        return self

    @property
    def positions(self):
        return self.outputs["PSM1/hand/phalanges/measured_js"][:9].reshape(3, 3).copy()

    @property
    def closings(self):
        return self.outputs["PSM1/hand/measured_js"][:3].copy()

    @property
    def torques(self):
        return self.outputs["PSM1/hand/measured_js"][12:].copy()


def test_the_engine_conforms_with_a_hand():
    check_engine(lambda: MujocoEngine("robot", MujocoParams.model_validate(SCENE)), period_ns=H)


@pytest.mark.parametrize(("mode", "closing"), [("folded", 0.0), ("retractor", 0.0), ("caliper", 0.3)])
def test_unloaded_fingers_come_to_rest_where_their_springs_say(mode, closing):
    goal = HAND.command(mode, closing)
    run = Run().go(goal)
    assert np.allclose(run.closings, goal[:3], atol=2e-3)
    assert np.allclose(run.positions, HAND.unloaded_positions(goal), atol=np.radians(0.1))
    assert np.abs(run.outputs["PSM1/hand/phalanges/measured_js"][9:18]).max() < 1e-3


def test_a_hand_starts_where_it_is_told():
    closings = HAND.command("caliper", 0.2)
    assert np.allclose(Run(hand=closings.tolist()).positions, HAND.unloaded_positions(closings), atol=1e-12)


def test_spheres_are_where_the_robots_kinematics_have_them():
    run = Run().go(HAND.command("caliper", 0.4), 300)
    shaft = arms.chain("PSM1", "MUSHA_HAND").frames(run.outputs["PSM1/measured_js"][:4])[3]
    expected = HAND.contacts(run.positions) @ shaft[:3, :3].T + shaft[:3, 3]
    found = [run.data.site(f"PSM1/contact/{sphere.name}").xpos for sphere in HAND.spheres(np.eye(4))]
    assert np.allclose(found, expected.reshape(9, 3), atol=1e-9)


def test_a_blocked_phalanx_lets_the_others_go_on():
    run = Run().go(HAND.command("grasp", 0.2), 600)
    start = run.positions
    joint = run.model.joint("PSM1/finger1_middle")
    run.model.jnt_range[joint.id] = -1.0, start[0, 1]  # something stands in its way
    command = HAND.command("grasp", 0.2)
    command[[0, 3]] = HAND.command("grasp", 0.4)[[0, 3]]
    run.go(command, 600)
    assert run.positions[0, 1] == pytest.approx(start[0, 1], abs=np.radians(1.0))
    # the distal joint takes up what is wound up
    assert run.positions[0, 2] > HAND.unloaded_positions(command)[0, 2] + np.radians(10.0)


def test_opening_pushes_no_harder_than_springs_and_rotor():
    """A tendon only pulls: a finger that opens pushes with its springs, not with the motor of its tendon."""
    run = Run().go(HAND.command("folded", 0.0), 100)
    joint = run.model.joint("PSM1/finger1_proximal")
    run.model.jnt_range[joint.id] = 0.0, 1.0  # something stands behind it
    run.go([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 500)
    assert -0.005 < run.torques[0] <= 0.0


def test_all_vertices_of_the_folded_hand_pass_the_trocar():
    for parts in (looks.parts("instrument/MUSHA_HAND"), looks.collision("instrument/MUSHA_HAND")):
        for body, shapes in parts.items():
            for shape in shapes if body != "insertion" else ():
                points = shape.vertices if isinstance(shape, looks.Part) else shape.pose[None, :3, 3]
                reach = 0.0 if isinstance(shape, looks.Part) else shape.size[0]
                assert (np.hypot(points[:, 0], points[:, 1]) + reach <= TROCAR_RADIUS).all(), shape.name


def test_fingers_touch_one_another_and_nothing_else_of_the_arm():
    run = Run().go(np.radians([10.0, 10.0, 0.0, 10.0, 10.0, 0.0]), 600)
    touching = {
        frozenset(run.model.geom(int(g)).name.split("/")[1].split("_")[0] for g in contact.geom)
        for contact in run.data.contact[: run.data.ncon]
    }
    assert touching
    assert all(len(pair) == 2 and all(name.startswith("finger") for name in pair) for pair in touching)


def test_modes_switch_the_hand_apart_from_the_arm():
    run = Run()
    run.values["PSM1/control_mode"] = np.array([1.0, 0.0])
    run.go(HAND.command("grasp", 0.8), 800)
    assert not run.torques.any()
    assert np.allclose(run.positions[:, 1:], 0.0, atol=1e-3)  # the springs stretch the fingers
    assert np.allclose(run.outputs["PSM1/measured_js"][:4], [0.0, 0.0, 0.12, 0.0], atol=1e-3)


def test_the_start_has_as_many_joints_as_the_arm_with_its_hand():
    with pytest.raises(ValidationError, match="expected 4: yaw, pitch, insertion, roll"):
        Run(start=[0, 0, 0.12, 0, 0, 0])
    with pytest.raises(ValidationError, match="finger1"):
        Run(hand=[4, 0, 0, 0, 0, 0])


def test_an_exported_hand_reads_back(tmp_path):
    scene = SceneParams.model_validate(SCENE)
    write(scene, tmp_path / "hand.xml", "mjcf")
    model, back = build(scene), mujoco.MjModel.from_xml_path(str(tmp_path / "hand.xml"))
    assert (model.nq, model.nu, model.ntendon, model.npair, model.nsensor) == (
        back.nq,
        back.nu,
        back.ntendon,
        back.npair,
        back.nsensor,
    )
    assert np.allclose(model.wrap_prm, back.wrap_prm, rtol=1e-5)  # MJCF has six digits
    write(scene, tmp_path / "hand.urdf", "urdf")
    robot = yourdfpy.URDF.load(str(tmp_path / "hand.urdf"), load_meshes=False)
    q = {**dict.fromkeys(robot.actuated_joint_names, 0.0), "PSM1_insertion": 0.12}
    command = HAND.command("caliper", 0.3)
    q |= dict(
        zip(
            (f"PSM1_{link.name}" for link in HAND.bones),
            HAND.unloaded_positions(command).ravel(),
            strict=True,
        )
    )
    robot.update_cfg(q)
    shaft = arms.chain("PSM1", "MUSHA_HAND").frames(np.array([0.0, 0.0, 0.12, 0.0]))[3]
    expected = (shaft @ [*HAND.contacts(HAND.unloaded_positions(command))[0, 2], 1.0])[:3]
    distal = robot.get_transform("PSM1_finger1_distal_link", "PSM1_base")
    assert np.allclose((distal @ [HAND.phalanges[-1].length, 0.0, 0.0, 1.0])[:3], expected, atol=1e-9)
