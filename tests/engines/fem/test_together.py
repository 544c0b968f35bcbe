"""Organs that touch each other and themselves: forces, momentum, no pass-through, and the same bits."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from engines.fem.solid import Branch, Solid, SphereWay
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from hub.participant import Inputs, Setup
from tests.engines.fem.rig import BLOCK, MS, FemRig, params

SOFT = Material(10e3, 0.4, 1000.0, 1e-3)
STEP = 1e-3


class Pair:
    """Solids that touch, with a way of spheres for each."""

    def __init__(self, *solids, ahead=5e-4, skin=1e-3, friction=0.0):
        from engines.fem._solid import Together as Compiled

        self.solids, self.forces = solids, np.zeros((len(solids), 3))
        middles, frictions = np.array([one.middle for one in solids]), np.full(len(solids), friction)
        compiled = tuple(one.compiled for one in solids)
        self.compiled = Compiled(compiled, middles, frictions, self.forces, ahead, skin)

    def go(self, seconds, place=None, target=None, gravity=0.0):
        """Advance; sphere 0, which touches nothing, goes from `place` to `target`."""
        k = max(one.sub_steps(STEP) for one in self.solids)
        place = np.zeros(3) if place is None else np.asarray(place, float)
        target = place if target is None else np.asarray(target, float)
        found = []
        for before, after in pairwise(np.linspace(place, target, round(seconds / STEP) + 1)):
            path = (before + np.linspace(0.0, 1.0, k + 1)[:, None] * (after - before))[:, None]
            way = SphereWay(path, np.full(1, 1e-3), np.zeros(1, np.uint8))
            spheres = [way.no_forces() for _ in self.solids]
            self.compiled.advance(
                tuple(
                    one.arguments(STEP, way, felt, 0.0, gravity, 0.0)
                    for one, felt in zip(self.solids, spheres, strict=True)
                )
            )
            found.append(sum(felt.mean(axis=0)[0] for felt in spheres))
        return np.array(found)


def solid(size, nodes, top=0.0, tied=None, shift=(0.0, 0.0), material=SOFT):
    mesh = block(np.array(size), nodes)
    mesh = TetMesh(mesh.nodes + np.array([*shift, top]), mesh.tetrahedra)
    anchored = np.zeros(len(mesh.nodes), bool) if tied is None else tied(mesh.nodes)
    return Solid(mesh, anchored, material, [Branch(1.0, 1e-3)])


def bottom(nodes):
    return nodes[:, 2] < nodes[:, 2].min() + 1e-9


def hold_top(one):
    for node in np.flatnonzero(one.nodes[:, 2] > one.nodes[:, 2].max() - 1e-9).tolist():
        one.hold(node, 0)


def momentum(*solids):
    return sum((one.mass.astype(float)[:, None] * one.velocity[:, :3]).sum(axis=0) for one in solids)


def test_blocks_pressed_together_bear_equal_and_opposite_force_as_one_block_does():
    under = solid((0.04, 0.03, 0.02), 200, tied=bottom)
    above = solid((0.034, 0.024, 0.02), 150, top=0.0201, shift=(7e-4, 3e-4))
    hold_top(above)
    pair = Pair(under, above)
    pair.go(0.1, (0.0, 0.0, 0.0), (0.0, 0.0, -2e-3))
    felt = pair.go(0.3, (0.0, 0.0, -2e-3))[-50:].mean(axis=0)
    assert felt[2] > 0.5
    assert pair.forces[1, 2] == pytest.approx(felt[2], rel=0.01)
    assert np.abs(pair.forces.sum(axis=0)).max() <= 1e-12 * felt[2]
    assert above.nodes[:, 2].min() < 0.0  # both give way


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_blocks_that_collide_keep_their_momentum_and_gain_no_energy(friction):
    """Velocities are in single precision: their sum is exact to that."""
    one = solid((0.02, 0.02, 0.02), 100)
    other = solid((0.02, 0.02, 0.02), 130, top=0.021, shift=(6e-3, 3e-3))
    one.velocity[:, 2], other.velocity[:, 2] = 0.5, -0.5
    before, size = momentum(one, other), one.mass.sum() * 0.5
    pair = Pair(one, other, friction=friction)
    pushed = 0.0
    for _ in range(60):
        pair.go(STEP)
        pushed = max(pushed, pair.forces[1, 2])
        assert np.abs(pair.forces.sum(axis=0)).max() <= 1e-12 * max(1.0, pushed)
    assert pushed > 0.3
    assert np.abs(momentum(one, other) - before).max() < 2e-5 * size
    assert momentum(other)[2] > 0.1 * size, "it bounces"
    kinetic = sum(0.5 * (each.mass[:, None] * each.velocity[:, :3] ** 2).sum() for each in (one, other))
    assert kinetic < 0.5 * (one.mass.sum() + other.mass.sum()) * 0.25


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_a_block_shot_at_another_does_not_pass_through(speed):
    """The speed of shear waves in this tissue is 2 m/s."""
    under = solid((0.04, 0.03, 0.01), 200, tied=bottom)
    above = solid((0.012, 0.01, 0.008), 60, top=0.012, shift=(1e-3, 1e-3))
    above.velocity[:, 2] = -speed
    pair = Pair(under, above)
    for _ in range(40):
        pair.go(STEP)
        assert above.nodes[:, 2].max() > under.nodes[:, 2].min() + 3e-3
    assert momentum(above)[2] > 0.0
    assert above.nodes[:, 2].min() > -1e-3


def deepest_of_fold(pair_of):
    """Fling the free end of a sheet over; return how deep it gets into the tied part, m."""
    mesh = block(np.array([0.06, 0.02, 0.002]), 150)
    hinge = 5e-3
    sheet = Solid(mesh, mesh.nodes[:, 0] < hinge, SOFT, [Branch(1.0, 1e-3)])
    free = mesh.nodes[:, 0] > hinge
    end = mesh.nodes[:, 0] > hinge + 0.012
    sheet.velocity[free, 0] = -120.0 * (mesh.nodes[free, 2] - 4e-3)
    sheet.velocity[free, 2] = 120.0 * (mesh.nodes[free, 0] - hinge)
    pair, deepest, landed = pair_of(sheet), 1.0, 0
    for _ in range(120):
        pair.go(STEP, gravity=9.81)
        above = end & (sheet.nodes[:, 0] < 0.0) & (sheet.nodes[:, 0] > -0.025)
        deepest = min(deepest, sheet.nodes[above, 2].min(initial=1.0))
        landed = max(landed, int((above & (sheet.nodes[:, 2] < 1e-3)).sum()))
    assert landed > 5
    return -deepest


def test_a_folded_sheet_does_not_pass_itself():
    assert deepest_of_fold(Pair) < 5e-4  # it lands at 3 m/s, 1 mm a sub-step
    assert deepest_of_fold(lambda sheet: Pair(sheet, ahead=0.0, skin=1e-4)) > 2e-3


def squeeze(pair_of, *, split):
    """Squeeze a free strip, split along its middle or not; return the force, N."""
    mesh = block(np.array([0.03, 0.02, 0.01]), 250)
    one = Solid(mesh, np.zeros(len(mesh.nodes), bool), SOFT, [Branch(1.0, 1e-3)], divisible=True)
    if split:
        sides = mesh.nodes[one.tetrahedra].mean(axis=1)[:, 1] > 0.0
        faces = np.arange(4 * len(sides))
        across = np.where(one.across < 0, faces, one.across)
        one.compiled.open(faces[sides[faces // 4] != sides[across // 4]].astype(np.int32))
    rest = mesh.nodes[one.origin]
    for node in np.flatnonzero(np.abs(rest[:, 1]) > 0.01 - 1e-9).tolist():
        one.hold(node, 0 if rest[node, 1] < 0.0 else 1)
    pair, k, felt = pair_of(one), one.sub_steps(STEP), np.zeros(0)
    for t in range(80):
        push = np.minimum(1.0, (t + np.linspace(0.0, 1.0, k + 1)) / 60.0) * 1e-3
        path = np.zeros((k + 1, 2, 3))
        path[:, 0, 1], path[:, 1, 1] = push, -push
        way = SphereWay(path, np.full(2, 1e-3), np.zeros(2, np.uint8))
        felt = way.no_forces()
        pair.compiled.advance((one.arguments(STEP, way, felt, 0.0, 0.0, 0.0),))
    return float(felt.mean(axis=0)[1, 1])


def test_the_sides_of_a_cut_bear_a_squeeze_as_uncut_tissue_does():
    whole = squeeze(Pair, split=False)
    assert whole > 0.3
    assert squeeze(lambda one: Pair(one, friction=0.3), split=True) == pytest.approx(whole, rel=0.03)
    assert squeeze(lambda one: Pair(one, ahead=0.0, skin=1e-4), split=True) < 0.02 * whole


def test_contact_changes_no_bit_of_organs_that_do_not_touch():
    hashes = []
    for on in (True, False):
        with FemRig(params({**BLOCK, "nodes": 75}, organ_contact=on), start=(0.0, 0.0, 6e-3)) as rig:
            rig.move((1e-3, 0.0, 2e-3), 0.05)
            hashes.append(rig.hashes)
    assert hashes[0] == hashes[1]


SMALL = {"size": ["20 mm", "16 mm", "10 mm"], "young_modulus": "10 kPa", "nodes": 75}
PILE = {
    "under": {**SMALL, "size": ["40 mm", "30 mm", "16 mm"], "nodes": 120},
    "on_top": {**SMALL, "position": ["1 mm", "2 mm", "11 mm"], "anchors": []},
}


def pile():
    engine = FemEngine("tissue", FemParams.model_validate({"organs": PILE, "probes": {}}))
    engine.configure(Setup(MS, Path(), {}))
    return engine


def run(engine, milliseconds, start=0):
    for i in range(start, start + milliseconds):
        engine.step(i * MS, MS, Inputs({}))


def test_an_organ_lies_on_another_with_its_weight():
    with pile() as engine:
        run(engine, 300)
        forces = []
        for i in range(50):
            run(engine, 1, 300 + i)
            forces.append(engine._together.forces.copy())
        weight = engine._organs[1].solid.mass.sum() * 9.80665
        assert np.mean(forces, axis=0)[1, 2] == pytest.approx(weight, rel=0.01)
        assert engine._organs[1].solid.nodes[:, 2].min() > -2e-3


def test_organs_that_touch_are_saved_and_restored_to_the_bit():
    with pile() as one, pile() as other:
        run(one, 30)
        other.restore(one.save())
        run(one, 30, 30)
        run(other, 30, 30)
        assert one.save() == other.save()
