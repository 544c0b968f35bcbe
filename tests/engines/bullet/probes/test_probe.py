"""A probe of one sphere or several: the coupling that follows from the tissue, and how proxies behave."""

from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from engines.bullet.engine import BulletEngine
from engines.tissue.probes.params import ProbeParams
from tests.engines.bullet.rig import SMALL_BLOCK, Rig, params

stiffnesses, steps = st.floats(1.0, 1e5), st.floats(1e-5, 1e-2)


@given(stiffnesses, steps)
def test_the_rules_make_the_lightest_critically_damped_proxy(contact, step):
    coupling = ProbeParams().coupling(contact, 1e-3, step)
    assert coupling.stiffness == pytest.approx(20 * contact)
    assert coupling.longest_step == pytest.approx(step)
    assert coupling.damping == pytest.approx(2 * sqrt(coupling.stiffness * coupling.mass))


@given(stiffnesses, stiffnesses, steps, st.floats(0, 1e-2))
def test_the_spring_is_reset_only_where_the_tissue_damps_what_that_makes(stiffness, contact, step, damping):
    coupling = ProbeParams.model_validate({"stiffness": stiffness}).coupling(contact, damping, step)
    if coupling.reset_time is not None:
        w = np.geomspace(1.0, 1e4, 50)
        compliance = 1 / (stiffness * (1 + 1 / (1j * w * coupling.reset_time))) + 1 / (
            contact * (1 + 1j * w * damping)
        )
        low = w * damping < 0.3  # up there, damping is no longer w d
        assert (compliance.imag[low] <= 1e-12).all()
    else:
        assert 4 * sqrt(coupling.mass / stiffness) > 0.5 * damping * stiffness / contact


def test_what_is_stated_is_taken():
    coupling = ProbeParams.model_validate(
        {"stiffness": "500 N/m", "mass": "20 g", "damping": "3 N*s/m"}
    ).coupling(1e3, 1e-3, 1e-3)
    assert (coupling.stiffness, coupling.mass, coupling.damping, coupling.reset_time) == (500, 0.02, 3, None)


def test_several_spheres_are_one_bond_of_points():
    (bond,) = BulletEngine(
        "tissue", params(SMALL_BLOCK, probe={"spheres": 3, "radius": ["2 mm", "3 mm", "4 mm"]})
    ).bonds
    assert (bond.dof, bond.points, bond.size, bond.side) == (3, 3, 9, "force")
    assert bond.proxy_step == 1e-3


@pytest.mark.parametrize(
    "wrong",
    [
        {"spheres": 3, "radius": ["2 mm", "3 mm"]},
        {"radius": ["2 mm", "3 mm"]},
        {"spheres": 0},
        {"radius": "0.1 mm"},
    ],
)
def test_spheres_that_do_not_fit_are_refused(wrong):
    with pytest.raises(ValidationError):
        ProbeParams.model_validate(wrong)


def test_overlapping_spheres_pass_through_each_other():
    start = np.array([[0.0, 0.0, 0.02], [3e-3, 0.0, 0.02]])
    with Rig(params(SMALL_BLOCK, probe={"spheres": 2, "radius": "5 mm"}), start=start) as rig:
        forces = np.concatenate([rig.move(start - np.array([0.0, 0.0, 5e-3]), 0.05), rig.hold(0.1)]).reshape(
            -1, 2, 3
        )
        assert not forces[:, :, :2].any()  # along the line through both
        assert np.abs(forces[-1]).max() < 1e-4


def test_at_rest_the_proxy_stands_where_the_instrument_does():
    with Rig(params(SMALL_BLOCK)) as rig:
        rig.move((0.0, 0.0, 2e-3), 0.1)
        rig.hold(0.15)
        assert rig.force[2] > 0.5
        np.testing.assert_allclose(rig.engine._probes[0].positions[0], [0.0, 0.0, 2e-3], atol=2e-6)
