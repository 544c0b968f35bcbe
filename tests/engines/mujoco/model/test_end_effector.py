from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yourdfpy

from controllers.motion.params import PsmParams
from controllers.motion.ports import arm_ports
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.export import write
from engines.mujoco.model import build
from engines.mujoco.params import MujocoParams, SceneParams
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from robots.dvrk import instruments
from robots.dvrk.end_effectors.end_effector import EndEffector
from tests.engines.mujoco.model.punch import Punch

H = 1_000_000
SCENE = {"arms": {"PSM1": {"instrument": "PUNCH"}}}
PUNCH = Punch()


@pytest.fixture(autouse=True)
def punch(monkeypatch):
    """An instrument with the toy end effector, by the name PUNCH."""
    known = instruments.instruments()
    tool = replace(known["LARGE_NEEDLE_DRIVER_400006"], name="PUNCH", number="", end_effector=PUNCH)
    monkeypatch.setattr(instruments, "instruments", lambda: {**known, "PUNCH": tool})


def engine():
    return MujocoEngine("robot", MujocoParams.model_validate(SCENE))


def test_a_new_end_effector_has_ports_servos_and_readings():
    robot = engine()
    outputs = robot.configure(Setup(period_ns=H, directory=Path(), bonds={}))
    values = {port.name: np.array(port.start) for port in robot.ports if port.causality == "input"}
    values["PSM1/punch/servo_jp"][:] = 5e-3
    for i in range(800):
        outputs = robot.step(i * H, H, Inputs(values))
    position, velocity, _effort = outputs["PSM1/punch/measured_js"]
    assert position == pytest.approx(5e-3, abs=5e-5)
    assert abs(velocity) < 1e-4
    assert [bond.name for bond in robot.bonds] == ["PSM1/contact"]


def test_a_new_end_effector_conforms():
    check_engine(engine, period_ns=H)


def test_its_pin_moves_along_the_tips_axis():
    model = build(SceneParams.model_validate(SCENE))
    data = mujoco.MjData(model)
    sphere = data.site("PSM1/contact/pin")
    mujoco.mj_forward(model, data)
    before = sphere.xpos.copy()
    data.joint("PSM1/pin").qpos[0] = 3e-3
    mujoco.mj_forward(model, data)
    ahead = data.site("PSM1/tip").xmat.reshape(3, 3)[:, 2]
    assert np.allclose(sphere.xpos - before, 3e-3 * ahead)
    assert model.body("PSM1/pin").mass[0] == pytest.approx(7900.0 * np.pi * 1e-6 * 0.01)


def test_the_motion_controller_commands_it():
    params = PsmParams.model_validate({"instrument": "PUNCH"})
    ports = [port.name for port in arm_ports("PSM1", params, "Cart", H)]
    assert {"PSM1/punch/move_jp", "PSM1/punch/measured_js", "drive/PSM1/punch/servo_jp"} <= set(ports)


def test_it_is_exported(tmp_path):
    scene = SceneParams.model_validate(SCENE)
    write(scene, tmp_path / "punch.xml", "mjcf")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "punch.xml")).nq == build(scene).nq
    write(scene, tmp_path / "punch.urdf", "urdf")
    pin = yourdfpy.URDF.load(str(tmp_path / "punch.urdf"), load_meshes=False).joint_map["PSM1_pin"]
    assert (pin.type, pin.limit.upper, pin.limit.effort) == ("prismatic", PUNCH.travel, 5.0)


def test_what_it_cannot_do_is_refused():
    with pytest.raises(ValueError, match="has no jaw; leave it out"):
        SceneParams.model_validate({"arms": {"PSM1": {"instrument": "PUNCH", "jaw": 0.2}}})


def test_the_protocol_is_small():
    own = [name for name in vars(EndEffector) if not name.startswith("_")]
    methods = [name for name in own if not isinstance(vars(EndEffector)[name], str)]
    assert len(methods) <= 8
