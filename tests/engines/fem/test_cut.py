"""Tissue that is cut, torn and taken away: work, mass, pieces, and bad days."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.fem.edges import Edges
from engines.fem.solid import Branch, Solid, SphereWay
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block
from schemas.errors import StateError
from tests.engines.fem.rig import FemRig, params

FIRM = Material(50e3, 0.45, 1000.0, 1e-3)
STRIP = block(np.array([0.03, 0.02, 0.01]), 700)
TOUGHNESS = 30.0
HIDDEN = np.zeros(2, np.uint8)
STEP = 1e-3


def strip(material=FIRM, mesh=STRIP):
    anchored = mesh.nodes[:, 2] < mesh.nodes[:, 2].min() + 1e-9
    return Solid(mesh, anchored, material, [Branch(1.0, 1e-3)], divisible=True)


def blade(toughness=TOUGHNESS):
    return Edges([(0, 1)], 40, toughness)


def draw(solid, edges, ways, seconds=STEP):
    """Move the ends of an edge along `ways`, shape (steps + 1, 2, 3); return force (steps, 3) and work."""
    k, forces, work = solid.sub_steps(seconds), [], 0.0
    for before, after in pairwise(ways):
        path = before + np.linspace(0.0, 1.0, k + 1)[:, None, None] * (after - before)
        found = solid.advance(seconds, SphereWay(path, np.full(2, 1e-4), HIDDEN, edges), 0.0, 0.0)
        forces.append(found.mean(axis=0).sum(axis=0))
        work -= float((found * np.diff(path, axis=0)).sum())
    return np.array(forces), work


def across(depth, start=-0.017, end=0.017, wave=0.0, steps=400):
    """A vertical edge through the strip along x, in waves about a line beside the middle."""
    x = np.linspace(start, end, steps + 1)
    y = 0.0 if wave else 0.0013
    upper = np.stack([x, y + wave * np.sin(200.0 * x), np.full_like(x, 2e-3)], axis=1)
    return np.stack([upper, upper - np.array([0.0, 0.0, 2e-3 + depth])], axis=1)


def mass_of(solid):
    return float(solid.mass.sum(dtype=np.float64))


def test_the_work_of_a_cut_is_toughness_times_area():
    solid, edges = strip(), blade()
    forces, work = draw(solid, edges, across(5e-3))
    area = 0.03 * 5e-3
    assert edges.area == pytest.approx(area, rel=0.05)
    assert work == pytest.approx(TOUGHNESS * area, rel=0.05)
    steady = forces[150:250].mean(axis=0)
    assert steady[0] == pytest.approx(-TOUGHNESS * 5e-3, rel=0.05)
    assert np.abs(steady[1:]).max() < 0.1 * abs(steady[0])


def test_a_cut_opens_both_sides_and_keeps_mass_and_shape():
    solid, edges = strip(), blade()
    mass, volume, faces = mass_of(solid), solid.elements[2].sum(), len(solid.faces)
    draw(solid, edges, across(5e-3))
    assert len(solid.origin) > len(STRIP.nodes) + 10
    assert (len(solid.faces) - faces) % 2 == 0
    assert mass_of(solid) == pytest.approx(mass, rel=1e-6)
    assert solid.elements[2].sum() == pytest.approx(volume, rel=1e-6)
    opened = solid.faces[faces:]
    rest = (solid.nodes - solid.displacement[:, :3])[opened].reshape(-1, 3)
    uncut = STRIP.nodes[solid.origin[opened.ravel()]]
    off, before = np.abs(rest[:, 1] - 0.0013).mean(), np.abs(uncut[:, 1] - 0.0013).mean()
    assert off < 0.6 * before, "nodes move onto the cut"


@pytest.mark.parametrize("wave", [0.0, 1.2e-3])
def test_a_cut_through_parts_the_body(wave):
    """Nodes that move onto the cut leave no bridge behind the blade."""
    solid = strip()
    draw(solid, blade(3.0), across(15e-3, wave=wave))
    sizes = np.sort(np.bincount(solid.pieces[solid.pieces >= 0]))
    assert sizes[-2] > 0.2 * sizes.sum()
    assert sizes[:-2].sum() < 0.02 * sizes.sum()


def test_an_edge_that_stops_short_of_the_limit_cuts_nothing_and_springs_back():
    solid, edges = strip(), blade(1000.0)
    draw(solid, edges, across(5e-3, end=-0.0145, steps=50))
    assert edges.area == 0.0
    draw(solid, edges, across(5e-3, start=-0.0145, end=-0.017, steps=50))
    assert len(solid.faces) == len(STRIP.triangles)
    draw(solid, edges, np.full((200, 2, 3), 1.0))
    assert np.abs(solid.displacement[:, :3]).max() < 2e-5


def test_an_edge_goes_back_through_its_cut_without_force():
    solid, edges = strip(), blade()
    draw(solid, edges, across(5e-3, end=0.0, steps=200))
    area = edges.area
    forces, _ = draw(solid, edges, across(5e-3, start=0.0, end=-0.017, steps=200))
    assert np.abs(forces[100:]).max() < 0.05 * TOUGHNESS * 5e-3  # one sample, at the mouth of the cut
    assert edges.area == pytest.approx(area, rel=0.05)


@given(st.integers(0, 2**32 - 1))
def test_random_cuts_keep_the_mass_and_stay_finite(seed):
    random = np.random.default_rng(seed)
    solid = strip(mesh=block(np.array([0.03, 0.02, 0.01]), 120))
    mass = mass_of(solid)
    for _ in range(8):
        corners = random.uniform([-0.02, -0.015, -0.015], [0.02, 0.015, 0.005], (4, 3)).reshape(2, 2, 3)
        steps = int(random.integers(1, 12))
        ways = corners[0] + np.linspace(0.0, 1.0, steps + 1)[:, None, None] * (corners[1] - corners[0])
        draw(solid, blade(float(random.uniform(1.0, 300.0))), ways)
    assert np.isfinite(solid.displacement).all()
    assert np.isfinite(solid.velocity).all()
    assert mass_of(solid) == pytest.approx(mass, rel=1e-6)


def test_a_blade_of_100_m_s_leaves_no_nan():
    solid = strip()
    draw(solid, blade(300.0), across(5e-3, start=-0.05, end=0.05, steps=1))
    draw(solid, blade(), np.full((50, 2, 3), 1.0))
    assert np.isfinite(solid.displacement).all()


def test_a_body_of_single_elements_falls_and_stays_finite():
    mesh = block(np.array([0.03, 0.02, 0.01]), 120)
    solid = strip(mesh=mesh)
    mass = mass_of(solid)
    solid.compiled.open(np.arange(4 * len(mesh.tetrahedra), dtype=np.int32))
    assert len(np.unique(solid.pieces)) == len(mesh.tetrahedra) + (solid.pieces == -1).any()
    assert len(solid.origin) == 4 * len(mesh.tetrahedra)
    way = SphereWay(np.zeros((solid.sub_steps(0.05) + 1, 0, 3)), np.zeros(0), np.zeros(0, np.uint8))
    solid.advance(0.05, way, 0.0, 9.81)
    assert np.isfinite(solid.displacement).all()
    assert mass_of(solid) == pytest.approx(mass, rel=1e-6)
    loose = mesh.nodes[solid.origin[solid.tetrahedra], 2].min(axis=1) > mesh.nodes[:, 2].min() + 1e-9
    fallen = solid.displacement[solid.tetrahedra[loose], 2]
    assert fallen == pytest.approx(-0.5 * 9.81 * 0.05**2, rel=0.01)
    assert solid.remove(np.arange(5)) == 5  # though there is no room for another node


def test_elements_go_with_their_mass():
    solid = strip()
    mass, volumes = mass_of(solid), solid.elements[2].copy()
    gone = np.arange(0, len(STRIP.tetrahedra), 3)
    assert solid.remove(gone) == len(gone)
    assert solid.remove(gone) == 0
    kept = 1.0 - volumes[gone].sum() / volumes.sum()
    assert mass_of(solid) == pytest.approx(kept * mass, rel=1e-5)
    way = SphereWay(np.zeros((solid.sub_steps(0.02) + 1, 0, 3)), np.zeros(0), np.zeros(0, np.uint8))
    solid.advance(0.02, way, 0.0, 9.81)
    assert np.isfinite(solid.displacement).all()
    with pytest.raises(ValueError, match="numbers are 0 to"):
        solid.remove(np.array([10**6]))


def pull_apart(solid, way, seconds=0.2, **limits):
    """Lift the top of the strip by `way`; return when it began to tear, and how many faces have opened."""
    top = np.flatnonzero(STRIP.nodes[:, 2] > -1e-9)
    for node in top.tolist():
        solid.hold(node, 0)
    lift = np.zeros((round(seconds / STEP) + 1, 1, 3))
    lift[:, 0, 2] = np.linspace(0.0, way, len(lift))
    began, torn = None, 0
    for k, (before, after) in enumerate(pairwise(lift)):
        path = before + np.linspace(0.0, 1.0, solid.sub_steps(STEP) + 1)[:, None, None] * (after - before)
        solid.advance(STEP, SphereWay(path, np.full(1, 1e-3), np.zeros(1, np.uint8)), 0.0, 0.0)
        opened = solid.tear(1.4, **limits) if k % 8 == 0 else 0
        began, torn = k if opened and began is None else began, torn + opened
    return began, torn


def test_tissue_stretched_beyond_its_limit_tears():
    solid = strip()
    _, torn = pull_apart(solid, 8e-3)
    assert torn > 0
    assert np.isfinite(solid.displacement).all()
    top = int(np.flatnonzero(solid.holder >= 0)[0])
    solid.let_go(top)
    assert solid.holder[top] == -1
    assert solid.inverse_mass[top] > 0.0


def test_a_tear_runs_through_a_strip_as_a_surface_and_leaves_few_crumbs():
    mesh = block(np.array([40e-3, 10e-3, 5e-3]), 900)
    x = mesh.nodes[:, 0]
    solid = Solid(mesh, x < x.min() + 1e-9, Material(50e3, 0.4, 1000.0, 1e-3), divisible=True)
    for node in np.flatnonzero(x > x.max() - 1e-9).tolist():
        solid.hold(node, 0)
    for k, before in enumerate(np.arange(0.0, 26e-3, 0.02e-3).tolist()):
        path = np.zeros((solid.sub_steps(STEP) + 1, 1, 3))
        path[:, 0, 0] = np.linspace(before, before + 0.02e-3, len(path))
        solid.advance(STEP, SphereWay(path, np.full(1, 1e-3), np.zeros(1, np.uint8)), 0.0, 0.0)
        if k % 8 == 0:
            solid.tear(1.6)
    pieces = solid.pieces
    sizes = np.sort(np.bincount(pieces[pieces >= 0]))[::-1]
    assert len(sizes) > 1
    assert sizes[:2].sum() > 0.99 * len(mesh.tetrahedra)


def test_a_cut_runs_on_by_its_toughness_below_the_stretch_at_which_tears_begin():
    def notched():
        solid = strip()
        middles = solid._middles.astype(float)
        left = middles[:, 0] < middles[:, 0].min() + 0.3 * np.ptp(middles[:, 0])
        below = middles[:, 2] < middles[:, 2].mean()
        across = solid._across
        other = np.where(across >= 0, across // 4, 0)
        faces = (across >= 0) & left[:, None] & (below[:, None] != below[other])
        assert solid.compiled.open(np.flatnonzero(faces.ravel()).astype(np.int32)) > 0
        return solid

    way = 0.2 * float(np.ptp(STRIP.nodes[:, 2]))
    tough, weak = notched(), notched()
    assert pull_apart(tough, way, toughness=1e4) == (None, 0)
    began, torn = pull_apart(weak, way, toughness=0.5)
    assert began is not None
    assert torn > 0


CUT = {
    "size": ["30 mm", "20 mm", "10 mm"],
    "nodes": 250,
    "young_modulus": "50 kPa",
    "cutting": {"toughness": "30 J/m^2"},
}
SCALPEL = {"spheres": 2, "radius": "1 mm", "blades": [[0, 1]]}
START = np.array([[-0.017, 0.0013, 0.002], [-0.017, 0.0013, -0.005]])


def engine_in_mid_cut():
    rig = FemRig(params(CUT, SCALPEL), START)
    rig.move(START + np.array([0.015, 0.0, 0.0]), 0.3)
    return rig


def test_a_probe_with_a_blade_cuts_the_organ_and_the_surface_goes_out():
    with engine_in_mid_cut() as rig:
        assert rig.force.sum(axis=0)[0] == pytest.approx(-30.0 * 5e-3, rel=0.15)
        change = rig.outputs["block/surface"]
        assert len(change.slots) > 20
        assert (change.kinds == 1).sum() >= 16
        assert len(rig.nodes) == len(rig.engine._organs[0].mesh.nodes) + len(change.origins)
        assert change.faces.max() < len(rig.nodes)


def test_a_cut_organ_is_saved_and_restored_to_the_bit():
    with engine_in_mid_cut() as rig, FemRig(params(CUT, SCALPEL), START) as other:
        saved, at = rig.engine.save(), rig.at.copy()
        other.engine.restore(saved)
        other.t, other.at[...] = rig.t, at
        assert other.engine.save() == saved
        for each in (rig, other):
            each.move(at + np.array([0.01, 0.0, 0.0]), 0.1)
        assert rig.hashes[-100:] == other.hashes
        assert rig.engine.save() == other.engine.save()
        with pytest.raises(StateError, match="was it saved elsewhere"):
            other.engine.restore(saved[:-8])
