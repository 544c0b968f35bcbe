import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import BondPlan, Correction, Inputs, Setup
from robots.dvrk import drives, psm
from robots.dvrk.instruments import instrument
from schemas.errors import MissingExtraError, ScenarioError, SessionError, StateError
from schemas.ports import bond_ports
from schemas.vectors import VectorCodec

H = 1_000_000
DRIVES = drives.psm(instrument("palpation-probe"))
START = [0.1, -0.05, 0.14, 0.2, 0.1, -0.1]
IMPULSE = BondPlan("velocity", mean=True)
LINEARISED = BondPlan("velocity", mean=True, correction=Correction(gain=0.5, stiffness=1000.0, damping=9.0))


class Run:
    """An engine with its inputs, stepped by hand."""

    def __init__(self, plan=IMPULSE, period=H, **params):
        self.engine = MujocoEngine(
            "robot", MujocoParams.model_validate({"arms": {"PSM1": {"start": START}}, **params})
        )
        bonds = {} if plan is None else {"PSM1/probe": plan}
        self.outputs = self.engine.configure(Setup(period_ns=period, directory=Path(), bonds=bonds))
        self.command, self.wrench = np.array(START), np.zeros(6)
        starts = {port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"}
        self.inputs = Inputs({**starts, "PSM1/servo_jp": self.command, "PSM1/probe/wrench": self.wrench})
        self.period, self.t = period, 0

    def steps(self, count):
        for _ in range(count):
            self.outputs = self.engine.step(self.t, self.period, self.inputs)
            self.t += self.period
        return self

    def output(self, port):
        return self.outputs[f"PSM1/{port}"].copy()


def wander(run, steps, seed=1):
    """Move command and wrench at random, the same way for the same seed."""
    random = np.random.default_rng(seed)
    for _ in range(steps):
        run.command += random.normal(0.0, 1e-4, 6)
        run.wrench[:] = random.normal(0.0, 0.3, 6) * [1, 1, 1, 0.01, 0.01, 0.01]
        run.steps(1)
    return run


def test_every_declared_output_is_there_from_the_start_and_fits_its_port():
    run = Run()
    outputs = [port for port in run.engine.ports if port.causality == "output"]
    outputs += [port for bond in run.engine.bonds for port in bond_ports(bond) if port.causality == "output"]
    for _ in range(2):
        assert set(run.outputs) == {port.name for port in outputs} | {"PSM1/probe/work"}
        for port in outputs:
            VectorCodec(port).check_vector(run.outputs[port.name])
        run.steps(1)


def test_without_a_bond_there_are_no_bond_outputs():
    assert not [name for name in Run(plan=None).steps(3).outputs if "probe" in name]


def test_the_arm_starts_at_rest_where_it_is_told():
    run = Run().steps(200)
    assert np.allclose(run.output("measured_js")[:6], START, atol=1e-9)
    assert np.allclose(run.output("probe/twist"), 0.0, atol=1e-9)


def test_measured_cp_is_the_forward_kinematics_of_measured_js():
    run = wander(
        Run(
            arms={"PSM1": {"start": START, "position": [0.3, 0.2, 0.1], "orientation": [0.5, 0.5, 0.5, 0.5]}}
        ),
        50,
    )
    tip = run.engine.params.arms["PSM1"].chain.forward(run.output("measured_js")[:6])
    assert np.allclose(run.output("measured_cp")[:3], tip[:3, 3], atol=1e-12)
    turn = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert np.allclose(run.output("probe/pose")[:3], [0.3, 0.2, 0.1] + turn @ tip[:3, 3], atol=1e-12)


def test_the_servo_reaches_its_goal_but_for_friction():
    run = Run()
    run.command += [0.05, -0.04, 0.01, 0.2, 0.1, -0.1]
    run.steps(1500)
    discs = drives.discs(instrument("palpation-probe"))
    losses = [
        DRIVES[name].coulomb_friction
        + sum(abs(disc.shares.get(name, 0.0)) * disc.coulomb_friction for disc in discs)
        for name in psm.JOINT_NAMES
    ]
    stiction = [loss / DRIVES[name].stiffness for loss, name in zip(losses, psm.JOINT_NAMES, strict=True)]
    assert (np.abs(run.output("measured_js")[:6] - run.command) <= np.array(stiction) * 1.01 + 1e-6).all()
    assert np.allclose(run.output("setpoint_js"), run.command)


def test_a_moving_command_is_followed_without_lag():
    run = Run()
    for _ in range(500):
        run.command[0] += 2e-4
        run.steps(1)
    lag_without_velocity_setpoint = 0.2 * DRIVES["yaw"].damping / DRIVES["yaw"].stiffness
    assert abs(run.output("measured_js")[0] - run.command[0]) < 0.2 * lag_without_velocity_setpoint


def test_joint_and_effort_limits_hold():
    run = Run()
    run.command[:] = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0]
    upper = np.array([joint.upper for joint in run.engine.params.arms["PSM1"].chain.joints])
    effort = np.array([joint.effort for joint in run.engine.params.arms["PSM1"].chain.joints])
    for _ in range(1500):
        run.steps(1)
        assert (np.abs(run.output("measured_js")[12:]) <= effort * (1 + 1e-9)).all()
    assert (run.output("measured_js")[:6] <= upper + 2e-3).all()
    assert np.allclose(run.output("setpoint_js"), upper)


@pytest.mark.parametrize("axis", range(3))
def test_a_force_moves_the_probe_its_way_and_the_arm_takes_energy(axis):
    run = Run()
    before = run.output("probe/pose")
    run.wrench[axis] = 5.0
    run.steps(300)
    assert run.output("probe/pose")[axis] > before[axis]
    assert run.output("probe/work")[0] < 0.0  # work done by the motion side: against the force


def test_the_book_is_force_times_way():
    run = Run()
    before = run.output("probe/pose")
    run.wrench[:3] = [3.0, -2.0, 4.0]
    run.steps(100)
    way = run.output("probe/pose")[:3] - before[:3]
    assert run.output("probe/work")[0] == pytest.approx(-float(run.wrench[:3] @ way), rel=1e-9)


def test_the_book_counts_torques():
    run = Run()
    run.wrench[3:] = [0.03, 0.02, -0.04]
    travelled = np.zeros(3)
    for _ in range(200):
        run.steps(1)
        travelled += run.output("probe/twist")[3:] * H * 1e-9
    assert np.linalg.norm(travelled) > 1e-4
    assert run.output("probe/work")[0] == pytest.approx(-float(run.wrench[3:] @ travelled), rel=0.02)


def test_effective_mass_is_the_least_that_a_blow_meets():
    blow = 1e4  # N for a microsecond: friction and servos have no say
    response = np.zeros((3, 3))
    for axis in range(3):
        run = Run(timestep="1 us", period=1000)
        run.wrench[axis] = blow
        response[:, axis] = run.steps(1).output("probe/twist")[:3] / (blow * 1e-6)
    assert run.engine.bonds[0].effective_mass == pytest.approx(
        1.0 / np.linalg.eigvalsh((response + response.T) / 2)[-1], rel=1e-3
    )


def test_the_linearised_correction_pulls_back_to_the_prediction():
    held, corrected = Run(), Run(plan=LINEARISED, period=5 * H)
    held.period = 5 * H
    for run in (held, corrected):
        run.wrench[2] = 5.0
        run.steps(1)
    moved = [abs(run.output("probe/pose")[2] - Run().output("probe/pose")[2]) for run in (held, corrected)]
    assert 0.0 < moved[1] < moved[0]


@pytest.mark.parametrize("plan", [IMPULSE, LINEARISED, None])
def test_equal_runs_have_equal_hashes(plan):
    runs = [wander(Run(plan), 60) for _ in range(2)]
    assert runs[0].engine.state_hash() == runs[1].engine.state_hash()
    runs[1].command[0] += 1e-13
    assert runs[0].steps(1).engine.state_hash() != runs[1].steps(1).engine.state_hash()


@pytest.mark.parametrize("plan", [IMPULSE, LINEARISED, None])
def test_restore_returns_to_the_same_bits(plan):
    run = wander(Run(plan), 40)
    saved, command, wrench, t = run.engine.save(), run.command.copy(), run.wrench.copy(), run.t
    first = (
        wander(run, 40, seed=2).engine.state_hash(),
        {name: value.copy() for name, value in run.outputs.items()},
    )
    for again in (run, Run(plan)):
        again.engine.restore(saved)
        assert again.engine.save() == saved
        again.command[:], again.wrench[:], again.t = command, wrench, t
        wander(again, 40, seed=2)
        assert again.engine.state_hash() == first[0]
        assert all((again.outputs[name] == first[1][name]).all() for name in first[1])


def test_a_state_of_another_size_is_refused():
    with pytest.raises(StateError, match="8 bytes"):
        Run().engine.restore(bytes(8))


def test_the_step_is_that_of_mj_step():
    run = Run(plan=None, timestep="1 ms")
    model = run.engine._model
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[::3] = run.engine._data.qpos, START
    mujoco.mj_forward(model, data)
    run.command += 0.01
    run.steps(1)
    data.ctrl[:] = run.engine._data.ctrl
    mujoco.mj_step(model, data)
    for _ in range(50):
        run.steps(1)
        data.ctrl[:] = run.engine._data.ctrl
        mujoco.mj_step(model, data)
    assert (data.qpos == run.engine._data.qpos).all()
    assert (data.qvel == run.engine._data.qvel).all()


@pytest.mark.parametrize(("port", "index"), [("servo_jp", 2), ("probe/wrench", 0)])
def test_a_nan_ends_the_session_and_says_where(port, index):
    run = Run()
    run.inputs[f"PSM1/{port}"][index] = np.nan
    with pytest.raises(SessionError, match=f"PSM1/{port}.*finite"):
        run.steps(2)


def test_an_unstable_simulation_ends_the_session_and_says_the_likeliest_cause(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = Run()
    run.wrench[2] = 1e18
    with pytest.raises(SessionError, match=r"from 0 s, arms PSM1.*unstable.*wrench"):
        run.steps(3)
    assert not list(tmp_path.iterdir())  # MuJoCo's own log file


def test_a_timestep_that_does_not_divide_the_period_is_refused():
    with pytest.raises(ScenarioError, match=r"timestep 0\.3 ms does not divide"):
        Run(timestep="0.3 ms")


def test_without_mujoco_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr("engines.mujoco.engine.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'trocar\[mujoco\]'"):
        Run()


def test_the_engine_is_imported_without_mujoco():
    code = "import sys, engines.mujoco.engine; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_close_may_be_called_twice():
    run = Run()
    run.engine.close()
    run.engine.close()
