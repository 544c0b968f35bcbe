"""The rims of a block, and the force of a sphere near one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.tissue.elasticity.rims import RimWatch, rim_share, rims_of
from engines.tissue.organs.params import OrganParams
from tests.engines.bullet.rig import BLOCK, RADIUS, Rig, params

DOWN = np.array([0.0, 0.0, -1.0])
BODY = OrganParams.model_validate({**BLOCK, "nodes": 75}).rest
RIMS = rims_of(BODY.nodes, BODY.triangles)


def test_a_block_has_its_twelve_edges():
    ends = BODY.nodes[RIMS.ends]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(4 * (0.08 + 0.06 + 0.02))
    assert np.allclose(np.einsum("esi,esi->es", RIMS.outward, RIMS.across), 0.0)
    assert np.allclose(np.einsum("ei,ei->e", RIMS.across[:, 0], RIMS.outward[:, 1]), 1.0)


def test_a_round_body_has_none():
    kidney = OrganParams.model_validate({"shape": "kidney-with-adrenal", "nodes": 250}).rest
    away = rims_of(kidney.nodes, kidney.triangles).vectors(np.array([0.0, -4e-3, 20e-3]), kidney.nodes)
    assert np.linalg.norm(away, axis=1).min() > 0.04


@pytest.mark.parametrize(
    ("centre", "away", "press"),
    [
        ((0.037, 0.0, 0.003), 3e-3, DOWN),
        ((0.037, 0.0, -0.004), 3e-3, DOWN),  # the sphere is deeper than its radius
        ((0.041, 0.0, 0.001), -1e-3, np.array([-1.0, 0.0, -1.0]) / np.sqrt(2.0)),
        ((0.039, 0.028, 0.003), 1e-3, DOWN),
    ],
    ids=["inside", "deep", "beyond", "nearer-of-two"],
)
def test_how_far_a_sphere_is_from_the_rim(centre, away, press):
    found = RIMS.near(np.array(centre), DOWN, BODY.nodes, 8e-3)
    assert found[0] == pytest.approx(away, abs=1e-9)
    assert np.allclose(found[1], press, atol=1e-9)


def test_in_the_middle_no_rim_is_near():
    assert RIMS.near(np.array([0.0, 0.0, 3e-3]), DOWN, BODY.nodes, 8e-3) is None


@given(st.integers(0, 2**32 - 1))
def test_a_watch_finds_the_rims_that_are_near(seed):
    watch, random = RimWatch(RIMS, BODY.nodes, 8e-3), np.random.default_rng(seed)
    centre = random.uniform((-0.045, -0.035, -4e-3), (0.045, 0.035, 6e-3))
    for _ in range(30):
        centre = centre + random.normal(0.0, 2e-3, 3)
        found, expected = watch.near(centre, DOWN), RIMS.near(centre, DOWN, BODY.nodes, 8e-3)
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert found[0] == expected[0]
            np.testing.assert_array_equal(found[1], expected[1])


def test_farther_away_more_is_left():
    depths = np.linspace(0.0, 2.0, 9)
    shares = np.array([rim_share(away, depths) for away in np.linspace(-0.2, 1.6, 10)])
    assert (np.diff(shares, axis=0) >= 0.0).all()
    assert shares.max() < 1.0


def test_three_millimetres_from_a_side_it_is_that_of_tissue():
    with Rig(params(BLOCK, sub_grid=True), start=(0.037, 0.0, RADIUS + 1e-3)) as rig:
        rig.move((0.037, 0.0, RADIUS - 3e-3), 0.06)
        rig.hold(0.15)
        assert rig.force[2] == pytest.approx(0.1421, rel=0.07)  # bench/tissue_truth.json
