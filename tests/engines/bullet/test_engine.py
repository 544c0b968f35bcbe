import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from engines.bullet.engine import BulletEngine
from hub.participant import BondPlan, Inputs, Setup
from schemas.errors import MissingExtraError, ScenarioError, SessionError, StateError
from tests.engines.bullet.rig import BLOCK, MS, RADIUS, SMALL_BLOCK, Rig, params, press_hashes


def test_ports_and_bonds_are_readable_before_configure():
    engine = BulletEngine("tissue", params(probe={"stiffness": "500 N/m", "mass": "20 g"}))
    nodes, stiffness = engine.ports
    assert (stiffness.name, stiffness.start, stiffness.limits) == ("probe/stiffness", (500.0,), (25.0, 500.0))
    assert (nodes.name, nodes.frame, nodes.period_ns) == ("block/nodes", "world", 16 * MS)
    (bond,) = engine.bonds
    assert (bond.name, bond.side, bond.dof, bond.frame) == ("probe", "force", 6, "world")
    assert bond.damping == pytest.approx(2 * np.sqrt(500 * 0.02))
    assert bond.contact_stiffness > 0


def test_the_first_outputs_hold_the_settled_nodes_and_the_surface():
    with Rig(params(SMALL_BLOCK)) as rig:
        state = rig.outputs["block/nodes"]
        assert state.header.frame_id == "world"
        assert state.triangles.reshape(-1, 3).max() < len(rig.nodes)
        assert not rig.outputs["probe/wrench"].any()
        assert -1e-3 < rig.nodes[:, 2].max() < 0  # sags under its weight
        rig.hold(0.016)
        assert rig.outputs["block/nodes"].header.stamp.ns == 16 * MS
        assert rig.outputs["block/nodes"].triangles.size == 0


def test_nodes_come_at_their_period_only():
    with Rig(params(SMALL_BLOCK, node_period="4 ms")) as rig:
        due = [i for i in range(12) if "block/nodes" in rig.engine.step(i * MS, MS, rig.inputs)]
        assert due == [3, 7, 11]


def test_how_often_the_nodes_are_output_does_not_change_the_physics():
    forces = []
    for node_period in ("1 ms", "64 ms"):
        with Rig(params(SMALL_BLOCK, node_period=node_period)) as rig:
            forces.append(rig.move((0.004, 0.003, RADIUS - 3e-3), 0.1))
    np.testing.assert_array_equal(*forces)


def test_same_inputs_give_the_same_hashes_in_another_process_and_beside_another_engine():
    program = subprocess.run(
        [sys.executable, "-m", "tests.engines.bullet.rig"], capture_output=True, text=True, check=True
    )
    expected = [int(value, 16) for value in program.stdout.split()]  # also: nothing else on stdout
    with Rig(params(SMALL_BLOCK)) as other:
        other.hold(0.01)
        assert press_hashes() == expected
        other.hold(0.01)
    assert len(set(expected)) == len(expected)


@pytest.mark.long
def test_no_force_before_contact_a_rising_force_in_it_and_none_after():
    with Rig() as rig:
        assert np.abs(rig.hold(0.2)[:, :3]).max() < 1e-3
        forces = []
        for depth in np.arange(1, 5) * 1e-3:
            rig.move((0.0, 0.0, RADIUS - depth), 0.1)
            rig.hold(0.1)
            forces.append(rig.force[2])
            assert np.abs(rig.force[:2]).max() < 0.05 * rig.force[2]  # pressed in the middle
        assert (np.diff(forces) > 0.05).all()
        rig.move((0.0, 0.0, RADIUS + 2e-3), 0.1)
        assert np.abs(rig.hold(0.2)[-50:, :3]).max() < 1e-3


def test_the_block_answers_alike_from_either_side():
    def lateral(sign):
        with Rig(params(SMALL_BLOCK), start=(sign * 6e-3, 0, RADIUS + 1e-3)) as rig:
            rig.move((sign * 6e-3, 0, RADIUS - 2e-3), 0.1)
            rig.hold(0.15)
            return rig.force

    left, right = lateral(-1), lateral(1)
    np.testing.assert_allclose(left * [-1, 1, 1], right, atol=0.03 * np.linalg.norm(right))


def test_the_work_is_force_times_motion_and_a_cycle_loses_energy():
    with Rig(params(SMALL_BLOCK)) as rig:
        rig.move((0, 0, RADIUS - 3e-3), 0.2)
        pressed = rig.outputs["probe/work"][0]
        rig.hold(0.1)
        rig.move((0, 0, RADIUS + 1e-3), 0.2)
        assert -0.01 * pressed < rig.outputs["probe/work"][0] < 0.5 * pressed
        booked, spent = rig.outputs["probe/work"][0], 1e-3 * sum(rig.power)
        assert booked == pytest.approx(spent, abs=0.02 * pressed)


@pytest.mark.parametrize("mean", [True, False])
def test_sub_steps_and_multiples_of_the_step(mean):
    with (
        Rig(params(SMALL_BLOCK), period=2 * MS, plan=BondPlan("velocity", mean)) as coarse,
        Rig(params(SMALL_BLOCK)) as fine,
    ):
        for rig in (coarse, fine):
            rig.move((0, 0, RADIUS - 2e-3), 0.1)
            rig.hold(0.2)
        np.testing.assert_allclose(coarse.force, fine.force, atol=2e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"poisson_ratio": 0.5},
        {"poisson_ratio": 0.0},
        {"young_modulus": "-1 kPa"},
        {"density": 0},
        {"size": [1, 1, 0]},
        {"nodes": 3},
        {"anchors": "top"},
    ],
)
def test_unphysical_organs_are_refused(wrong):
    with pytest.raises(ValidationError):
        params({**BLOCK, **wrong})


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        (params(timestep="0.3 ms"), "does not divide the period"),
        (params(node_period="2.5 ms"), "no multiple of the period"),
        (params(probe={"stiffness": "10 kN/m", "mass": "20 g"}), "0.5 sqrt\\(mass / stiffness\\)"),
        (
            params({**BLOCK, "young_modulus": "200 kPa"}, timestep="1 ms"),
            "organ 'block'.*highest natural frequency",
        ),
        (params({**BLOCK, "young_modulus": "30 kPa", "damping": 0}, timestep="1 ms"), "raise the damping"),
    ],
)
def test_steps_that_are_too_long_are_refused(model, expected):
    engine = BulletEngine("tissue", model)
    with engine, pytest.raises(ScenarioError, match=expected):
        engine.configure(Setup(MS, Path(), {}))


def test_an_unstable_organ_ends_the_session_and_names_it(monkeypatch):
    monkeypatch.setattr("engines.bullet.engine.longest_step", lambda frequency, damping: 1.0)
    with (
        pytest.raises(SessionError, match=r"organ 'block' became unstable by .* timestep"),
        Rig(params({**SMALL_BLOCK, "young_modulus": "500 kPa", "damping": 0}, timestep="1 ms")),
    ):
        pass


def test_a_motion_that_is_not_finite_ends_the_session_and_names_the_probe():
    with Rig(params(SMALL_BLOCK)) as rig:
        rig.hold(0.005)
        rig.pose[2] = np.nan
        with pytest.raises(SessionError, match=r"probe 'probe'.*at 0\.006 s"):
            rig.hold(0.001)


@pytest.mark.parametrize(
    ("modulus", "step"), [("10 kPa", 1_000_000), ("50 kPa", 500_000), ("300 kPa", 250_000)]
)
def test_a_sub_step_that_is_not_stated_is_one_at_which_the_tissue_is_stable(modulus, step):
    block = {**BLOCK, "nodes": 250, "young_modulus": modulus, "damping": "0.25 ms"}
    model = params(block)
    assert model.sub_step == step
    with Rig(model) as rig:
        rig.move((0.0, 0.0, RADIUS - 1e-3), 0.02)
        assert np.isfinite(rig.nodes).all()
    assert params(block, timestep="0.125 ms").sub_step == 125_000


@pytest.mark.parametrize("sub_grid", [True, False])
def test_the_start_is_restored_bit_for_bit(sub_grid):
    model = params({**SMALL_BLOCK, "friction": 0.5}, sub_grid=sub_grid)

    def press(rig, x, depth):
        rig.hashes.clear()
        rig.at[...], rig.speed[...], rig.t = (x, 0.0, RADIUS + 1e-3), 0.0, 0
        rig.move((x, 0.0, RADIUS - depth), 0.05)
        rig.move((x + 5e-3, 0.0, RADIUS - depth), 0.05)  # drags, and ends in contact
        return list(rig.hashes)

    with Rig(model) as rig:
        start, nodes = rig.engine.save(), rig.nodes.copy()
        first = press(rig, 1e-3, 3e-3)
        with pytest.raises(StateError, match="only the start"):
            rig.engine.save()
        rig.engine.restore(start)
        assert rig.engine.save() == start
        other = press(rig, -8e-3, 4e-3)
        rig.engine.restore(start)
        assert np.array_equal(np.asarray(rig.engine._organs[0].nodes, np.float32), nodes.astype(np.float32))
        assert press(rig, 1e-3, 3e-3) == first
    with Rig(model) as rig:
        assert press(rig, -8e-3, 4e-3) == other


def test_the_start_of_other_organs_is_refused():
    softer = params({**SMALL_BLOCK, "young_modulus": "9 kPa"})
    with (
        Rig(params(SMALL_BLOCK)) as one,
        Rig(softer) as other,
        pytest.raises(StateError, match="with the same organs"),
    ):
        other.engine.restore(one.engine.save())
    with pytest.raises(StateError, match="only the start"):
        BulletEngine("tissue", params()).save()
    with Rig(params(SMALL_BLOCK, standstill=False)) as moving, pytest.raises(StateError, match="standstill"):
        moving.engine.save()


def test_close_may_be_called_at_any_time():
    engine = BulletEngine("tissue", params(SMALL_BLOCK))
    engine.close()
    engine.configure(Setup(MS, Path(), {}))
    assert set(engine.step(0, MS, Inputs({}))) == set()  # a probe without a bond stays away
    engine.close()
    engine.close()


def test_without_pybullet_the_pip_line_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    engine = BulletEngine("tissue", params())
    with pytest.raises(MissingExtraError, match=r"pip install 'trocar\[bullet\]'"):
        engine.configure(Setup(MS, Path(), {}))
    engine.close()


def test_nothing_reaches_stdout(capfd):
    with Rig(params(SMALL_BLOCK)) as rig:
        rig.hold(0.005)
    assert capfd.readouterr().out == ""
