"""The model's equations of motion: against identified ones, energy, gravity compensation, servos at rest."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.model import build
from engines.mujoco.model.dynamics import dynamics
from engines.mujoco.params import MujocoParams, SceneParams
from hub.participant import Inputs, Setup
from robots import rotation
from robots.dvrk import arm_bodies, ecm, linkage, psm, setup_joints
from robots.dvrk.dynamics import Dynamics, of_ecm, of_psm
from robots.dvrk.ecm import JOINT_NAMES as ECM_JOINTS
from robots.dvrk.instruments import instrument
from robots.dvrk.own_dynamics import BodyInertia, DiscLosses, JointLosses, OwnDynamics

REFERENCE = json.loads(
    (Path(__file__).parents[3] / "robots" / "data" / "reference_dynamics.json").read_text()
)
NEEDLE_DRIVER = "LARGE_NEEDLE_DRIVER_400006"
TILTS = [np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.5, 0.5, 0.5, 0.5]), np.array([0.2, -0.4, 0.1, 0.889])]


def tilted(arm, tilt, **params):
    orientation = (tilt / np.linalg.norm(tilt)).tolist()
    return {"arms": {arm: {"orientation": orientation, **params}}, "looks": False}


@pytest.mark.parametrize(
    "case", REFERENCE["cases"][:6] + REFERENCE["cases"][-3:], ids=lambda case: str(case["q"])
)
def test_the_model_has_the_identified_dynamics(case):
    found = dynamics("PSM1", NEEDLE_DRIVER, case["q"], [0.0] * 6)
    assert np.allclose(found.inertia[:3, :3], case["inertia"], rtol=0.0, atol=0.05 * np.max(case["inertia"]))
    assert np.allclose(
        found.gravity[:3], case["gravity"], rtol=0.0, atol=0.05 * np.max(np.abs(case["gravity"]))
    )
    if "elastic" in case:
        assert np.allclose(found.elastic[:4], case["elastic"], atol=1e-6)


@pytest.mark.parametrize("arm", ["PSM1", "ECM"])
def test_the_model_moves_as_the_closed_form_says(arm):
    """Two ways to the same numbers: MuJoCo's tree with its linkage, and the sum over displacements."""
    q = np.array([0.4, -0.5, 0.13, 0.7, 0.3, -0.6])[: 4 if arm == "ECM" else 6]
    closed = of_ecm() if arm == "ECM" else of_psm(instrument(NEEDLE_DRIVER))
    found = dynamics(arm, "straight" if arm == "ECM" else NEEDLE_DRIVER, q.tolist(), [0.0] * q.size)
    assert np.allclose(found.inertia, closed.inertia_matrix(q), atol=1e-6)
    assert np.allclose(found.gravity, closed.gravity(q), atol=1e-5)


def test_an_endoscope_arm_has_the_dynamics_of_its_file(tmp_path):
    q, heavy = np.array([0.4, -0.5, 0.13, 0.7]), {**arm_bodies.ecm()}
    heavy["insertion"] = replace(heavy["insertion"], mass=2.0 * heavy["insertion"].mass)
    losses = {name: JointLosses(armature=0.0, stiffness=1e-3, offset=0.0, viscous=0.3) for name in ECM_JOINTS}
    bodies = {name: BodyInertia(mass=b.mass, centre=b.centre, tensor=b.tensor) for name, b in heavy.items()}
    own = OwnDynamics(instrument="endoscope", bodies=bodies, joints=losses, discs=[])
    (tmp_path / "ecm.yaml").write_text(own.text(), "utf-8")
    found = dynamics("ECM", "straight", q.tolist(), [0.0] * 4, tmp_path / "ecm.yaml")
    closed = Dynamics(ecm.chain(), linkage.ECM, heavy, np.zeros(4))
    assert np.allclose(found.gravity, closed.gravity(q), atol=1e-5)
    assert not np.allclose(found.gravity, of_ecm().gravity(q), atol=0.1)
    assert np.allclose(found.viscous_friction, 0.3)


def test_fingers_rub_on_their_pin_as_the_file_says(tmp_path):
    tool, q = instrument(NEEDLE_DRIVER), [0.4, -0.5, 0.13, 0.7, 0.3, -0.6]
    chain, bodies = psm.chain(tool), arm_bodies.psm(tool)
    losses = {one.name: JointLosses(armature=0.0, stiffness=1e-3, offset=0.0) for one in chain.joints}
    own = OwnDynamics(
        instrument=NEEDLE_DRIVER,
        bodies={
            name: BodyInertia(mass=b.mass, centre=b.centre, tensor=b.tensor) for name, b in bodies.items()
        },
        joints=losses,
        discs=[DiscLosses()] * 4,
        fingers=[DiscLosses(coulomb=0.004), DiscLosses(coulomb=0.006), DiscLosses(coulomb=0.012)],
    )
    (tmp_path / "psm.yaml").write_text(own.text(), "utf-8")
    found = dynamics("PSM1", NEEDLE_DRIVER, q, [0.0] * 6, tmp_path / "psm.yaml")
    assert np.allclose(found.coulomb_friction, [0.0, 0.0, 0.0, 0.0, 0.0, 0.01])


@pytest.mark.parametrize("arm", ["PSM2", "ECM"])
@pytest.mark.parametrize(
    "base",
    [
        {"mounting": "free", "orientation": (TILTS[2] / np.linalg.norm(TILTS[2])).tolist()},
        {"mounting": "cart"},
        {"mounting": "cart", "setup_joints": [0.1, 0.4, -0.3, 0.2, 0.9, -0.7]},
    ],
    ids=str,
)
def test_gravity_is_that_of_the_base_as_it_stands(arm, base):
    if arm == "ECM" and "setup_joints" in base:
        base = {**base, "setup_joints": [*base["setup_joints"][:4], 0.0, 0.0]}
    q = np.array([0.4, -0.5, 0.13, 0.7, 0.3, -0.6])[: 4 if arm == "ECM" else 6]
    closed = of_ecm() if arm == "ECM" else of_psm(instrument(NEEDLE_DRIVER))
    tool = "straight" if arm == "ECM" else NEEDLE_DRIVER
    found = dynamics(arm, tool, q.tolist(), [0.0] * q.size, base=base)
    if "orientation" in base:
        turn = rotation.matrix(np.array(base["orientation"]))
    else:
        held = np.array(base.get("setup_joints", setup_joints.SIMULATED[arm]))
        turn = setup_joints.base_pose(arm, held)[:3, :3]
    assert np.allclose(found.base, turn, atol=1e-12)
    assert np.allclose(found.gravity, closed.gravity(q, turn.T @ [0.0, 0.0, -9.81]), atol=2e-5)
    assert np.allclose(found.inertia, closed.inertia_matrix(q), atol=1e-6)


class Run:
    """An engine with one arm, stepped by hand."""

    def __init__(self, arm, scene):
        self.arm = arm
        self.engine = MujocoEngine("robot", MujocoParams.model_validate(scene))
        self.outputs = self.engine.configure(Setup(period_ns=1_000_000, directory=Path(), bonds={}))
        starts = {
            port.name: np.array(port.start, float) for port in self.engine.ports if port.causality == "input"
        }
        self.command, self.mode = starts[f"{arm}/servo_jp"], starts[f"{arm}/control_mode"]
        self.inputs, self.t = Inputs(starts), 0

    def steps(self, count):
        for _ in range(count):
            self.outputs = self.engine.step(self.t, 1_000_000, self.inputs)
            self.t += 1_000_000
        return self

    @property
    def q(self):
        return self.outputs[f"{self.arm}/measured_js"][: self.command.size].copy()


@pytest.mark.parametrize("tilt", TILTS, ids=str)
# springs at rest
@pytest.mark.parametrize(
    ("arm", "start"), [("PSM1", [-0.054, -0.2134, 0.2, -1.52, 0.2, -0.4]), ("ECM", [0.5, 0.8, 0.1, 0.4])]
)
def test_gravity_compensation_holds_the_arm_however_its_base_stands(arm, start, tilt):
    run = Run(arm, tilted(arm, tilt, start=start))
    run.mode[:] = [2.0, 2.0]
    run.steps(5)
    before = run.q
    run.steps(300)
    assert np.allclose(run.q, before, atol=1e-6)


def test_an_arm_that_is_let_go_stays_where_springs_pull_less_than_friction():
    run = Run("PSM1", tilted("PSM1", TILTS[0], instrument=NEEDLE_DRIVER))
    run.mode[:] = [2.0, 2.0]
    run.steps(100)
    before = run.q
    run.steps(1000)
    assert np.abs(run.q - before).max() < 1e-5


def test_an_arm_that_is_let_go_gives_way_to_more_than_its_friction():
    run = Run("PSM1", tilted("PSM1", TILTS[0], instrument=NEEDLE_DRIVER))
    run.mode[:] = [2.0, 2.0]
    run.inputs["PSM1/servo_jf"][:] = [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    run.steps(300)
    assert run.q[0] > 0.05


def test_the_friction_under_the_servo_is_as_soft_as_before():
    """A session that lets an arm go and takes it again goes on as one that was restored to the same state."""
    run = Run("PSM1", tilted("PSM1", TILTS[0], instrument=NEEDLE_DRIVER))
    run.mode[:] = [2.0, 2.0]
    run.steps(50)
    run.mode[:] = [1.0, 1.0]
    run.steps(50)
    saved = run.engine.save()
    other = Run("PSM1", tilted("PSM1", TILTS[0], instrument=NEEDLE_DRIVER))
    other.engine.restore(saved)
    other.command[:] = run.command
    hashes = {part.steps(1).engine.state_hash() for part in (run, other)}
    assert len(hashes) == 1


@pytest.mark.parametrize("arm", ["PSM1", "ECM"])
def test_without_torque_the_arm_sinks_unless_it_has_brakes(arm):
    start = [0.0, 0.3, 0.1, 0.0, 0.0, 0.0] if arm == "PSM1" else [0.0, 0.3, 0.1, 0.0]
    run = Run(arm, tilted(arm, np.array([0.0, 0.7, 0.0, 0.7]), start=start))
    run.mode[:] = 0.0
    run.steps(400)
    assert (np.abs(run.q - start).max() > 1e-2) == (arm == "PSM1")


@pytest.mark.parametrize(
    "goal",
    [
        [0.5, -0.4, 0.2, 1.0, 0.5, -0.4],
        [-1.2, 0.8, 0.05, -2.0, -0.6, 0.7],
        [0.05, 0.02, 0.11, 0.05, 0.02, 0.03],
    ],
    ids=str,
)
def test_the_servo_comes_to_rest_where_it_is_told(goal):
    run = Run("PSM1", tilted("PSM1", TILTS[1], instrument=NEEDLE_DRIVER))
    start, goal, seconds = run.q, np.array(goal), 2.0
    for i in range(int(seconds * 1000)):
        s = (i + 1) / (seconds * 1000)
        run.command[:] = start + (goal - start) * s**3 * (10 - 15 * s + 6 * s**2)
        run.steps(1)
    run.steps(500)
    error = np.abs(run.q - goal)
    assert error[2] < 0.05e-3
    assert np.delete(error, 2).max() < np.radians(0.05)


def test_a_free_arm_without_friction_keeps_its_energy():
    model = build(
        SceneParams.model_validate({"arms": {"PSM1": {"instrument": NEEDLE_DRIVER}}, "looks": False}), 1e-4
    )
    model.dof_damping[:] = model.dof_frictionloss[:] = model.tendon_damping[:] = model.tendon_frictionloss[
        :
    ] = 0.0
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = model.body_gravcomp[:] = 0.0
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = data.energy.copy()
    kinetic = 0.0
    for _ in range(4000):
        mujoco.mj_step(model, data)
        kinetic = max(kinetic, float(data.energy[1]))
    assert kinetic > 0.005  # J: it does move
    assert abs(data.energy.sum() - start.sum()) < 0.02 * kinetic


def test_the_wrist_of_a_tilted_base_feels_gravity_turned():
    tilt = TILTS[2] / np.linalg.norm(TILTS[2])
    model = build(SceneParams.model_validate(tilted("PSM1", tilt, instrument=NEEDLE_DRIVER)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [
        f"PSM1/{name}"
        for name in (
            "yaw",
            "pitch",
            "insertion",
            "counterweight",
            "pitch_back",
            "pitch_front",
            "pitch_bottom",
            "pitch_top",
        )
    ]
    follow = np.array(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [0, 1, 0], [0, 1, 0], [0, -1, 0], [0, -1, 0]]
    )
    found = follow.T @ [data.qfrc_bias[int(model.joint(name).dofadr[0])] for name in names]
    pull = rotation.matrix(tilt).T @ [0.0, 0.0, -9.81]
    assert np.allclose(found, of_psm(instrument(NEEDLE_DRIVER)).gravity(np.zeros(6), pull)[:3], atol=1e-4)
