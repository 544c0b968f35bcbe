"""Sub-steps of stiff and soft organs side by side, and organs with added mass for motion."""

import numpy as np
import pytest

from engines.fem.organ import Organ
from engines.fem.solid import Branch, Solid, SphereWay
from engines.fem.sub_steps import common_sub_steps, own_sub_steps
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block
from tests.engines.fem.rig import BLOCK, params
from tests.engines.fem.test_attachments import AREA, PLATE, STRENGTH, TOUGHNESS, UP, PlateRig, given

STIFF = {"flap": {"young_modulus": "1 MPa"}, "own_sub_steps": True, "gravity": 0.0}


def energy(solid):
    """Return elastic and kinetic energy of a body without branches, J."""
    corners, gradients, volume = solid.elements
    gradients = gradients.reshape(-1, 3, 3)
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    places, bulk = solid.displacement[:, :3].astype(float), float(solid._limits[0])
    F = np.eye(3) + np.einsum("mai,maj->mij", places[corners], gradients)
    J, trace = np.linalg.det(F), np.einsum("mij,mij->m", F, F)
    mu = solid._shear.ravel().astype(float)
    around = np.bincount(corners.ravel(), np.repeat(volume, 4))
    mean = np.bincount(corners.ravel(), np.repeat(volume * J, 4)) / around
    elastic = volume @ (0.5 * mu * (trace - 3.0 - np.log((trace + 1.0) / 4.0)) - 0.75 * mu * (J - 1.0))
    kinetic = 0.5 * solid.mass.astype(float) @ (solid.velocity[:, :3].astype(float) ** 2).sum(axis=1)
    return float(elastic + 0.125 * bulk * around @ (mean - 1.0) ** 2 + kinetic)


def test_a_plan_gives_soft_organs_longer_steps_by_powers_of_two():
    assert common_sub_steps(1e-3, [400e-6, 30e-6]) == (34, (1, 1))
    assert common_sub_steps(1e-3, [400e-6], 7) == (7, (1,))
    plan = own_sub_steps(1e-3, [400e-6, 30e-6, 75e-6], 34, [500, 100, 100])
    assert plan.total % max(plan.every) == 0
    step = 1e-3 / plan.total
    assert plan.every[1] == 1
    assert plan.every[0] == 8
    for every, longest in zip(plan.every, [400e-6, 30e-6, 75e-6], strict=True):
        assert every == 1 or every * step <= 0.75 * longest


def test_organs_that_hang_together_differ_by_a_factor_of_two_at_most():
    longest = [800e-6, 90e-6, 20e-6]
    assert own_sub_steps(1e-3, longest, 48, [500] * 3).every == (8, 2, 1)
    assert own_sub_steps(1e-3, longest, 48, [500] * 3, [(0, 1), (1, 2)]).every == (4, 2, 1)
    assert own_sub_steps(1e-3, longest, 48, [500] * 3, [(2, 0)]).every == (2, 2, 1)


def test_an_organ_alone_goes_as_with_its_long_sub_steps():
    mesh = block(np.array([0.03, 0.02, 0.01]), 100)
    solids = [
        Solid(mesh, mesh.nodes[:, 2] < -0.0099, Material(20e3, 0.4, 1000.0, 1e-3), [Branch(1.0, 1e-3)])
        for _ in range(2)
    ]
    still = [SphereWay(np.zeros((n + 1, 0, 3)), np.zeros(0), np.zeros(0, np.uint8)) for n in (16, 64)]
    for solid, way, every in zip(solids, still, (1, 4), strict=True):
        solid.velocity[:, 0] = 0.2 * (solid.inverse_mass > 0.0)
        solid.advance(1e-3, way, 0.0, 9.8, every=every)
    assert np.abs(solids[0].velocity - solids[1].velocity).max() < 1e-5
    assert np.abs(solids[0].displacement[:, :3] - solids[1].displacement[:, :3]).max() < 1e-9


def test_forces_come_in_whole_parts_of_a_step():
    solid = Organ("block", params().organs["block"]).solid
    way = SphereWay(np.zeros((11, 0, 3)), np.zeros(0), np.zeros(0, np.uint8))
    with pytest.raises(ValueError, match="whole part"):
        solid.advance(1e-3, way, 0.0, 0.0, every=4)


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("modulus", ["0.3 MPa", "3 MPa"])
def test_ties_of_stiff_organs_add_no_energy(own, modulus):
    plate = PLATE | {"strength": "1 MPa", "toughness": "1 kJ/m^2"}
    flap = {"young_modulus": modulus, "damping": 0.0}
    with PlateRig(gravity=0.0, plate=plate, bed={"damping": 0.0}, flap=flap, own_sub_steps=own) as rig:
        organs = rig.engine._organs
        assert [organ.every > 1 for organ in organs] == [own, False]
        rng = np.random.default_rng(0)
        for organ in organs:
            free = organ.solid.inverse_mass[:, None] > 0.0
            organ.solid.velocity[:, :3] = 0.1 * rng.standard_normal((len(free), 3)) * free
        before = sum(energy(organ.solid) for organ in organs)
        rig.hold(0.15)
        assert 0.9 < sum(energy(organ.solid) for organ in organs) / before < 1.05
        assert rig.freed == 0.0


def test_momentum_of_a_stiff_and_a_soft_organ_is_kept():
    free = {"anchors": []}
    with PlateRig(bed=free, **STIFF) as rig:
        organs = rig.engine._organs
        assert organs[0].every > 1
        organs[1].solid.velocity[:, 0] = 0.1

        def momenta():
            masses = [organ.solid.mass.astype(float) for organ in organs]
            speeds = [organ.solid.velocity[:, :3].astype(float) for organ in organs]
            places = [organ.solid.nodes for organ in organs]
            linear = sum(m @ v for m, v in zip(masses, speeds, strict=True))
            turning = sum(m @ np.cross(x, v) for m, x, v in zip(masses, places, speeds, strict=True))
            return linear, turning

        linear, turning = momenta()
        rig.hold(0.02)
        now, spinning = momenta()
        assert np.abs(now - linear).max() < 1e-4 * np.abs(linear).max()
        assert np.abs(spinning - turning).max() < 2e-3 * np.abs(turning).max()


@pytest.mark.long
def test_strength_and_work_of_ties_hold_for_organs_with_other_sub_steps():
    with PlateRig(**STIFF) as rig:
        assert rig.engine._organs[0].every > 1
        rig.take()
        felt = []
        for _ in range(100):
            rig.move(rig.at + UP, 0.008)
            felt.append(rig.pulled[2])
        assert rig.freed == pytest.approx(AREA, rel=1e-6)
        assert -min(felt) == pytest.approx(STRENGTH * AREA, rel=0.1)
        assert sum(rig.power) * 1e-3 == pytest.approx(TOUGHNESS * AREA, rel=0.06)


def test_organs_with_other_sub_steps_are_saved_and_restored_to_the_bit():
    with PlateRig(**STIFF) as rig, PlateRig(**STIFF) as other:
        for each in (rig, other):
            each.take()
        rig.move(rig.at + 20 * UP, 0.1)
        other.engine.restore(rig.engine.save())
        other.t, other.at[:] = rig.t, rig.at
        for each in (rig, other):
            each.move(each.at + 20 * UP, 0.05)
        assert rig.hashes[-50:] == other.hashes[-50:]


def test_added_mass_moves_slowly_and_weighs_nothing():
    light, heavy = (
        Organ("block", params({**BLOCK, "inertia": share}).organs["block"]) for share in (1.0, 16.0)
    )
    assert heavy.solid.longest_step == pytest.approx(4.0 * light.solid.longest_step, rel=1e-4)
    sunk = []
    for organ in (light, heavy):
        organ.settle(9.80665)
        sunk.append(float(organ.solid.displacement[:, 2].min()))
    assert sunk[0] < 0.0
    assert sunk[1] == pytest.approx(sunk[0], rel=1e-3)


def test_added_mass_hangs_by_its_own_weight():
    hanging = {"orientation": [1.0, 0.0, 0.0, 0.0], "anchors": [{"surface": "bottom"}]}
    below = {"position": ["1 mm", "0.7 mm", "-0.3 mm"], "inertia": 20.0}
    with PlateRig(bed=hanging, flap=below) as rig:
        weight = float(rig.flap.solid.mass.sum()) / 20.0 * 9.80665
        rig.hold(0.3)
        assert rig.pulled[2] == pytest.approx(weight, rel=0.03)


def test_too_much_added_mass_is_refused():
    with pytest.raises(ValueError, match="less than or equal to 100"):
        given(flap={"inertia": 1000.0})
