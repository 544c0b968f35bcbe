from pathlib import Path

import mujoco
import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.interaction.mechanics import effective_mass
from engines.mujoco.params import MujocoParams
from hub.participant import BondPlan, Correction, Inputs, Setup
from hub.testing import check_engine
from robots.dvrk.instruments import instrument
from schemas.vectors import Vector

H = 1_000_000
TOOL = "LARGE_NEEDLE_DRIVER_400006"
N = len(instrument(TOOL).spheres)
START = [0.1, -0.05, 0.14, 0.2, 0.1, -0.1]
JAW = 0.6
IMPULSE = BondPlan("velocity", mean=True)
LINEARISED = BondPlan("velocity", mean=True, correction=Correction(gain=0.5, stiffness=1000.0, damping=9.0))
TURNED = {"position": [0.3, 0.2, 0.1], "orientation": [0.5, 0.5, 0.5, 0.5]}


class Run:
    """An engine with its inputs, stepped by hand."""

    def __init__(self, plan=IMPULSE, period=H, jaw=JAW, **arm):
        params = {"arms": {"PSM1": {"instrument": TOOL, "start": START, "jaw": jaw, **arm}}, "looks": False}
        self.engine = MujocoEngine("robot", MujocoParams.model_validate(params))
        self.outputs = self.engine.configure(
            Setup(period_ns=period, directory=Path(), bonds={} if plan is None else {"PSM1/contact": plan})
        )
        self.force = np.zeros(3 * N)
        starts = {port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"}
        self.inputs = Inputs({**starts, "PSM1/contact/force": self.force})
        self.period, self.t = period, 0

    def steps(self, count):
        for _ in range(count):
            self.outputs = self.engine.step(self.t, self.period, self.inputs)
            self.t += self.period
        return self

    def output(self, port) -> Vector:
        return self.outputs[f"PSM1/{port}"].copy()

    @property
    def model(self):
        return self.engine._model, self.engine._data


def test_spheres_of_a_closed_jaw_touch_in_the_plane_of_the_pads():
    run = Run(jaw=0.0)
    left, right = run.output("contact/position").reshape(2, N // 2, 3)
    radius = instrument(TOOL).spheres[0].radius
    assert np.allclose(np.linalg.norm(left - right, axis=1), 2.0 * radius, atol=1e-12)


def test_spheres_end_with_the_jaw_and_leave_no_gap_along_it():
    for tool in ("400006", "400049", "400093"):
        jaw, spheres = instrument(tool).jaw, instrument(tool).spheres
        left = spheres[: len(spheres) // 2]
        reach = [np.hypot(*np.array(sphere.position)[:2]) for sphere in left]
        along = np.sqrt(np.square(reach) - left[0].radius ** 2)
        assert along[-1] + left[-1].radius == pytest.approx(jaw.length)
        assert (np.diff(along) <= 2.0 * left[0].radius + 1e-12).all()
        assert [sphere.link for sphere in spheres] == ["jaw_left"] * len(left) + ["jaw_right"] * len(left)


def test_an_open_jaw_parts_its_spheres_by_the_jaw_angle():
    left, right = Run().output("contact/position").reshape(2, N // 2, 3)
    spheres = instrument(TOOL).spheres[: N // 2]
    for a, b, sphere in zip(left, right, spheres, strict=True):
        reach = np.linalg.norm(sphere.position)
        half = JAW / 2 + np.arcsin(sphere.radius / reach)
        assert np.linalg.norm(a - b) == pytest.approx(2.0 * reach * np.sin(half), abs=1e-9)


def test_velocity_is_the_slope_of_the_position():
    run = Run()
    run.force[:] = np.random.default_rng(1).normal(0.0, 0.3, 3 * N)
    run.steps(20)
    before = run.output("contact/position")
    velocity = run.output("contact/velocity")
    run.steps(1)
    mean = (velocity + run.output("contact/velocity")) / 2.0
    assert np.allclose(run.output("contact/position") - before, mean * 1e-3, atol=1e-8)


@pytest.mark.parametrize("plan", [IMPULSE, LINEARISED])
def test_work_is_what_the_arm_gains(plan):
    """Without drives and losses, all energy of the arm comes through the bond."""
    run = Run(plan)
    model, data = run.model
    model.opt.timestep = 5e-4
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.opt.gravity[:] = 0.0
    model.dof_damping[:] = model.dof_frictionloss[:] = model.tendon_damping[:] = model.tendon_frictionloss[
        :
    ] = 0.0
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    model.jnt_stiffness[:] = 0.0
    run.inputs = Inputs(
        {
            **{
                name: run.inputs[name]
                for name in ("PSM1/servo_jp", "PSM1/servo_jf", "PSM1/jaw/servo_jp", "PSM1/jaw/servo_jf")
            },
            "PSM1/control_mode": np.zeros(2),
            "PSM1/contact/force": run.force,
        }
    )
    run.force[:] = np.random.default_rng(2).normal(0.0, 0.02, 3 * N)
    run.steps(40)
    kinetic = float(data.energy[1])
    assert kinetic > 1e-6
    assert run.output("contact/work")[0] == pytest.approx(-kinetic, rel=0.02)


def test_the_book_is_force_times_way():
    run = Run()
    run.force[:] = np.random.default_rng(3).normal(0.0, 0.3, 3 * N)
    before, work = run.output("contact/position"), 0.0
    for _ in range(10):
        run.steps(1)
        work -= float(run.force @ (run.output("contact/position") - before))
        before = run.output("contact/position")
    assert run.output("contact/work")[0] == pytest.approx(work, rel=1e-9)


def test_forces_on_the_spheres_are_those_that_mujoco_would_apply_there():
    run = Run(**TURNED)
    model, data = run.model
    random = np.random.default_rng(4)
    run.force[:] = random.normal(0.0, 0.5, 3 * N)
    run.steps(1)
    expected, got = np.zeros(model.nv), np.zeros(model.nv)
    for i, sphere in enumerate(instrument(TOOL).spheres):
        site = model.site(f"PSM1/contact/{sphere.name}").id
        mujoco.mj_applyFT(
            model,
            data,
            run.force[3 * i : 3 * i + 3],
            np.zeros(3),
            data.site_xpos[site],
            model.site_bodyid[site],
            expected,
        )
    for body in range(model.nbody):
        mujoco.mj_applyFT(
            model, data, data.xfrc_applied[body, :3], data.xfrc_applied[body, 3:], data.xipos[body], body, got
        )
    # the moments are those of half a millisecond before
    assert np.allclose(got, expected, rtol=1e-2, atol=1e-4)


def test_the_tip_feels_force_and_moment_in_the_base_frame():
    run = Run(**TURNED)
    data = run.model[1]
    run.force[:] = np.random.default_rng(5).normal(0.0, 0.3, 3 * N)
    assert not run.output("tip_wrench").any()
    run.steps(1)
    base, tip = data.site("PSM1/base").xmat.reshape(3, 3), data.site("PSM1/tip").xpos
    force = run.force.reshape(N, 3)
    moment = np.cross(run.output("contact/position").reshape(N, 3) - tip, force)
    assert np.allclose(
        run.output("tip_wrench"), [*(base.T @ force.sum(axis=0)), *(base.T @ moment.sum(axis=0))], atol=1e-12
    )


def test_the_tip_of_a_palpation_probe_feels_the_bonds_wrench():
    engine = MujocoEngine("robot", MujocoParams.model_validate({"arms": {"PSM1": TURNED}, "looks": False}))
    engine.configure(Setup(period_ns=H, directory=Path(), bonds={"PSM1/probe": IMPULSE}))
    inputs = {port.name: np.array(port.start) for port in engine.ports if port.causality == "input"}
    outputs = engine.step(
        0, H, Inputs({**inputs, "PSM1/probe/wrench": np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])})
    )
    assert np.allclose(outputs["PSM1/tip_wrench"], [2.0, 3.0, 1.0, 0.0, 0.0, 0.0])


def test_without_a_bond_the_tip_feels_nothing():
    run = Run(plan=None).steps(3)
    assert not [name for name in run.outputs if "contact" in name]
    assert not run.output("tip_wrench").any()


def test_effective_mass_is_below_that_of_each_sphere_and_above_a_share_of_it():
    """The largest eigenvalue is at least that of any block on the diagonal, and at most the sum of theirs."""
    run = Run()
    model, data = run.model
    single = []
    for sphere in instrument(TOOL).spheres:
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, jacobian, None, model.site(f"PSM1/contact/{sphere.name}").id)
        single.append(effective_mass(jacobian, model, data))
    (bond,) = run.engine.bonds
    assert 1.0 / np.sum(1.0 / np.array(single)) <= bond.effective_mass <= min(single)


@pytest.mark.parametrize("plan", [IMPULSE, LINEARISED])
def test_equal_runs_have_equal_hashes_and_restore_returns_to_the_same_bits(plan):
    hashes = []
    for _ in range(2):
        run = Run(plan)
        run.force[:] = np.random.default_rng(6).normal(0.0, 0.3, 3 * N)
        run.steps(10)
        state = run.engine.save()
        run.steps(10)
        hashes.append(run.engine.state_hash())
    assert hashes[0] == hashes[1]
    run.engine.restore(state)
    assert run.steps(10).engine.state_hash() == hashes[0]


def test_the_engine_conforms_with_contact_spheres():
    params = {"arms": {"PSM1": {"instrument": TOOL, "jaw": JAW}}, "looks": False}
    check_engine(
        lambda: MujocoEngine("robot", MujocoParams.model_validate(params)),
        period_ns=H,
        inputs={"PSM1/contact/force": np.full(3 * N, 0.1)},
    )
