"""Bad input and bad days of tissue that is cut: no NaN, no element that stays turned over, the same bits."""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from engines.fem.edges import Edges
from engines.fem.solid import SphereWay
from engines.tissue.meshing.grid import block
from schemas.errors import SessionError
from tests.engines.fem.heat.test_instrument import CauteryRig
from tests.engines.fem.rig import BLOCK, FemRig, params
from tests.engines.fem.test_cut import CUT, SCALPEL, START, across, draw, engine_in_mid_cut, mass_of, strip


def turned_over(solid):
    """Return how many elements have no volume, or a negative one."""
    corners, gradients, volumes = solid.elements
    u = solid.displacement[:, :3].astype(float)[corners]
    F = np.eye(3) + np.einsum("mai,maj->mij", u[:, 1:] - u[:, :1], gradients.reshape(-1, 3, 3))
    return int(((np.linalg.det(F) <= 0.0) & (volumes > 0.0)).sum())


def random_cut(random, solid):
    """Draw a blade by a random way through a strip."""
    corners = random.uniform([-0.02, -0.015, -0.015], [0.02, 0.015, 0.005], (4, 3)).reshape(2, 2, 3)
    steps = int(random.integers(2, 12))
    ways = corners[0] + np.linspace(0.0, 1.0, steps + 1)[:, None, None] * (corners[1] - corners[0])
    draw(solid, Edges([(0, 1)], 40, float(random.uniform(1.0, 100.0))), ways)


def rest(solid, seconds, gravity=0.0):
    k = solid.sub_steps(seconds)
    solid.advance(
        seconds, SphereWay(np.zeros((k + 1, 0, 3)), np.zeros(0), np.zeros(0, np.uint8)), 0.0, gravity
    )


def test_a_hundred_random_cuts_leave_mass_and_no_element_turned_over():
    random, solid = np.random.default_rng(3), strip(mesh=block(np.array([0.03, 0.02, 0.01]), 120))
    mass = mass_of(solid)
    for _ in range(100):
        random_cut(random, solid)
    rest(solid, 0.3)
    assert np.isfinite(solid.displacement).all()
    assert mass_of(solid) == pytest.approx(mass, rel=1e-6)
    assert turned_over(solid) == 0


def test_a_stated_sub_step_that_is_too_long_is_shortened():
    with FemRig(
        params({**BLOCK, "nodes": 75}, timestep="50 ms", node_period="20 ms"),
        start=(0.0, 0.0, 6e-3),
        period=20_000_000,
    ) as rig:
        rig.move((0.0, 0.0, 2e-3), 0.2)
        assert 0.05 < rig.hold(0.2)[-1, 2] < 1.0


@pytest.mark.parametrize("speed", [10.0, 100.0])
def test_a_blade_far_too_fast_ends_with_a_word_or_not_at_all(speed):
    with FemRig(params(CUT, SCALPEL), START) as rig, suppress(SessionError):
        rig.follow(
            lambda t: (START + np.array([speed * t, 0.0, 0.0]), np.full((2, 3), [speed, 0.0, 0.0])),
            0.04 / speed + 1e-3,
        )
        rig.follow(lambda t: (START, np.zeros((2, 3))), 0.1)
    assert np.isfinite(rig.wrenches).all()


def test_a_cut_through_the_anchor_leaves_both_sides_anchored():
    solid = strip()
    draw(solid, Edges([(0, 1)], 40, 3.0), across(15e-3))
    rest(solid, 0.1, 9.81)
    assert np.isfinite(solid.displacement).all()
    fixed = solid.inverse_mass == 0.0
    base = (solid.nodes - solid.displacement[:, :3])[:, 2] < -0.01 + 1e-6
    assert fixed[base].all()
    assert np.abs(solid.displacement[base, :3]).max() < 1e-4
    assert len(np.unique(solid.pieces[solid.pieces >= 0])) >= 2


def test_an_organ_cut_to_single_elements_goes_on():
    with FemRig(params(CUT, SCALPEL), START) as rig:
        organ = rig.engine._organs[0]
        organ.solid.compiled.open(np.arange(4 * len(organ.mesh.tetrahedra), dtype=np.int32))
        organ.follow_surface()
        rig.move(START + np.array([0.03, 0.0, 0.0]), 0.1)
        rig.hold(0.3)
        assert np.isfinite(rig.wrenches).all()
        assert np.isfinite(rig.nodes).all()


@pytest.mark.long
def test_power_without_contact_heats_nothing():
    with CauteryRig(start=(0.0, 0.0, 0.02), power=60.0) as rig:
        rig.watts[0] = 60.0
        rig.hold(0.1)
        assert rig.number("probe/delivered") == 0.0
        assert rig.number("block/hottest") == 37.0


def go_on(saved):
    """Return the hashes of an engine that goes on from the state in a file."""
    with FemRig(params(CUT, SCALPEL), START) as rig:
        rig.engine.restore(Path(saved).read_bytes())
        rig.t = 300_000_000
        rig.at[...] = START + np.array([0.015, 0.0, 0.0])
        rig.move(START + np.array([0.025, 0.0, 0.0]), 0.1)
        return rig.hashes


@pytest.mark.long
def test_a_cut_goes_on_in_another_process_with_the_same_bits(tmp_path):
    with engine_in_mid_cut() as rig:
        (tmp_path / "state").write_bytes(rig.engine.save())
        rig.move(START + np.array([0.025, 0.0, 0.0]), 0.1)
        here = rig.hashes[-100:]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "tests.engines.fem.test_bad_days", str(tmp_path / "state")],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
        env={"PYTHONPATH": str(Path(__file__).parents[3])},
    )
    assert [int(number, 16) for number in done.stdout.split()] == here


if __name__ == "__main__":
    sys.stdout.write(" ".join(f"{number:016x}" for number in go_on(sys.argv[1])))
