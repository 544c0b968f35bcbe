"""A soft body against theory: stress, relaxation, a column of 0.49; the same bits without SIMD."""

import importlib.util
import subprocess
import sys
import sysconfig
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import engines.fem._solid as compiled
from engines.fem.solid import Branch, Solid, SphereWay
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from tests.engines.bullet.finite_elements import internal_forces

SOFT = Material(10e3, 0.4, 1000.0, 1e-3)
MESH = block(np.array([0.04, 0.04, 0.02]), 60)
NO_SPHERES = np.zeros(0), np.zeros(0, np.uint8)


def free_solid(mesh=MESH, material=SOFT, branches=()):
    return Solid(mesh, np.zeros(len(mesh.nodes), bool), material, branches)


def forces(solid, seconds=0.0):
    solid.compiled.forces(seconds)
    return solid.force[:, :3].astype(float)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 0.4))
def test_forces_of_a_uniform_strain_are_those_of_the_energy(seed, size):
    random = np.random.default_rng(seed)
    gradient = np.eye(3) + size * random.uniform(-1.0, 1.0, (3, 3))
    solid = free_solid()
    solid.displacement[:, :3] = (MESH.nodes - solid.middle) @ (gradient - np.eye(3)).T
    truth = internal_forces(MESH.nodes, MESH.tetrahedra, MESH.nodes @ gradient.T, *SOFT.neo_hookean_lame)
    assert np.abs(forces(solid) - truth).max() < 1e-4 * np.abs(truth).max()


@given(st.integers(0, 2**32 - 1))
def test_forces_of_any_strain_neither_push_nor_turn_the_body(seed):
    solid = free_solid(branches=[Branch(1.0, 1e-3)])
    solid.displacement[:, :3] = 2e-3 * np.random.default_rng(seed).standard_normal((len(MESH.nodes), 3))
    found = forces(solid, 1e-4)
    size = np.abs(found).sum()
    assert np.abs(found.sum(axis=0)).max() < 1e-5 * size
    assert np.abs(np.cross(solid.nodes, found).sum(axis=0)).max() < 1e-5 * size * 0.04


def test_forces_are_the_gradient_of_an_energy():
    """Around a closed path of displacements the elastic forces do no work."""
    random = np.random.default_rng(1)
    one, other = (1e-3 * random.standard_normal((len(MESH.nodes), 3)) for _ in range(2))
    solid, work, stored = free_solid(), 0.0, 0.0
    angles = np.linspace(0.0, 2.0 * np.pi, 401)
    places = [one * np.cos(angle) + other * np.sin(angle) for angle in angles]
    for before, after in pairwise(places):
        solid.displacement[:, :3] = 0.5 * (before + after)
        part = float((forces(solid) * (after - before)).sum())
        work, stored = work + part, stored + abs(part)
    assert abs(work) < 1e-4 * stored


def test_stress_relaxes_as_the_series_says():
    series = [Branch(0.6, 0.05), Branch(0.3, 0.4)]
    solid = free_solid(branches=series)
    solid.displacement[:, 0] = 0.01 * (MESH.nodes[:, 2] - solid.middle[2])  # simple shear
    long_term = forces(free_solid_like(solid))
    dt = 1e-3
    for i in range(1, 600):
        found = forces(solid, dt)
        if i in (1, 50, 200, 599):
            expected = 1.0 + sum(one.share * np.exp(-i * dt / one.seconds) for one in series)
            ratio = float((found[:, 0] @ long_term[:, 0]) / (long_term[:, 0] @ long_term[:, 0]))
            assert ratio == pytest.approx(expected, rel=0.02)


def free_solid_like(solid):
    """Return an elastic body with the same displacements."""
    other = free_solid()
    other.displacement[:] = solid.displacement
    return other


@pytest.mark.parametrize("poisson_ratio", [0.3, 0.49])
def test_a_column_sags_as_its_modulus_says(poisson_ratio):
    """The upper half by rho g L^2 / (8 E), away from the tied base, whatever the Poisson ratio."""
    length, material = 0.06, Material(20e3, poisson_ratio, 1000.0, 1e-3)
    mesh = block(np.array([0.012, 0.012, length]), 400)
    anchored = mesh.nodes[:, 2] < -length + 1e-9
    solid = Solid(mesh, anchored, material, [Branch(1.0, 1e-3)])
    for drag in (40.0, 40.0, 0.0):
        k = solid.sub_steps(0.5)
        solid.advance(0.5, SphereWay(np.zeros((k + 1, 0, 3)), *NO_SPHERES), 0.0, 9.81, drag=drag)
    levels = np.unique(mesh.nodes[:, 2].round(9))
    middle = levels[np.abs(levels + 0.5 * length).argmin()]
    at_top, at_middle = (
        float(solid.displacement[np.abs(mesh.nodes[:, 2] - level) < 1e-6, 2].mean())
        for level in (0.0, middle)
    )
    expected = 1000.0 * 9.81 * middle**2 / (2.0 * material.young_modulus)
    assert at_middle - at_top == pytest.approx(expected, rel=0.03)


def sphere_press(solid, centre, radius, depth, friction=0.0, aside=0.0, seconds=0.3):
    """Press into the top, stay, then drag aside; return the mean force on the sphere in the last half."""
    free, radii, k = np.ones(1, np.uint8), np.array([radius]), solid.sub_steps(1e-3)
    high = np.add(centre, [0.0, 0.0, radius + 5e-4])
    low = np.add(centre, [0.0, 0.0, radius - depth])
    steps = round(seconds * 1e3)
    ways = [np.linspace(high, low, 41), np.tile(low, (steps, 1))]
    if aside:
        ways.append(np.linspace(low, np.add(low, [aside, 0.0, 0.0]), round(aside / 2e-5)))
    found = []
    places = np.concatenate(ways)
    for before, after in pairwise(places):
        path = np.linspace(before, after, k + 1)[:, None]
        found.append(solid.advance(1e-3, SphereWay(path, radii, free), friction, 0.0).mean(axis=0)[0])
    return np.mean(found[-len(ways[-1]) // 2 :], axis=0)


def slab(nodes=250):
    mesh = block(np.array([0.08, 0.06, 0.02]), nodes)
    anchored = mesh.nodes[:, 2] < -0.02 + 1e-9
    return Solid(mesh, anchored, SOFT, [Branch(1.0, 1e-3)])


def test_no_face_enters_a_sphere_and_it_feels_only_push():
    solid = slab()
    force = sphere_press(solid, (1e-3, 2e-3, 0.0), 5e-3, 3e-3)
    centre = np.array([1e-3, 2e-3, 2e-3])
    assert force[2] > 0.3
    assert np.linalg.norm(solid.nodes - centre, axis=1).min() > 5e-3 - 2e-5


def test_friction_stays_in_its_cone_and_reaches_it():
    solid = slab()
    force = sphere_press(solid, (0.0, 0.0, 0.0), 5e-3, 2e-3, friction=0.2, aside=8e-3)
    assert -force[0] == pytest.approx(0.2 * force[2], rel=0.25)  # facets tilt the normals
    without = sphere_press(slab(), (0.0, 0.0, 0.0), 5e-3, 2e-3, friction=0.0, aside=8e-3)
    assert abs(without[0]) < 0.5 * abs(force[0])


def test_a_jaw_feels_what_presses_on_the_tissue_that_it_holds():
    solid = free_solid(block(np.array([0.04, 0.04, 0.02]), 60), branches=[Branch(1.0, 1e-3)])
    held = np.flatnonzero((solid.nodes[:, 2] > -1e-9) & (solid.nodes[:, 0] < 1e-3))
    for node in held.tolist():
        solid.hold(node, 1)
    k, radii, free = solid.sub_steps(1e-3), np.full(2, 4e-3), np.array([1, 0], np.uint8)
    felt = np.zeros((2, 3))
    for step in range(300):
        way = np.zeros((k + 1, 2, 3))
        way[:, 0] = [12e-3, 1e-3, max(3e-3, 5e-3 - 2e-5 * step)]
        felt = solid.advance(1e-3, SphereWay(way, radii, free), 0.0, 0.0, drag=50.0).mean(axis=0)
    assert felt[0, 2] > 0.05
    assert felt.sum(axis=0) == pytest.approx(np.zeros(3), abs=0.01 * felt[0, 2])


def compiled_with(folder, flag):
    """Return the body, compiled with a flag for other lanes than the usual ones."""
    library = folder / f"_solid{sysconfig.get_config_var('EXT_SUFFIX')}"
    room = Path(compiled.__file__).parent
    command = ["cc", "-O2", "-ffp-contract=off", flag, "-shared", "-fPIC"]
    command += [f"-I{sysconfig.get_path('include')}", "-o", str(library)]
    subprocess.run([*command, *map(str, sorted(room.glob("*.c"))), "-lm"], check=True)
    spec = importlib.util.spec_from_file_location("engines.fem._solid", library)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="calls cc")
@pytest.mark.parametrize("flag", ["-DTROCAR_PLAIN_LANES", "-DTROCAR_NARROW_LANES"])
def test_plain_c_and_four_lanes_have_the_bits_of_eight(flag, tmp_path, monkeypatch):
    usual = slab(120)
    sphere_press(usual, (1e-3, 2e-3, 0.0), 4e-3, 2e-3, friction=0.3, aside=1e-3, seconds=0.05)
    monkeypatch.setitem(sys.modules, "engines.fem._solid", compiled_with(tmp_path, flag))
    plain = slab(120)
    assert type(plain.compiled) is not type(usual.compiled)
    sphere_press(plain, (1e-3, 2e-3, 0.0), 4e-3, 2e-3, friction=0.3, aside=1e-3, seconds=0.05)
    for one, other in zip(usual.state, plain.state, strict=True):
        assert one.tobytes() == other.tobytes()


def test_the_bits_do_not_depend_on_the_place_in_memory():
    results = []
    for _ in range(3):
        solid = slab(120)
        sphere_press(solid, (0.0, 0.0, 0.0), 4e-3, 2e-3, friction=0.3, seconds=0.03)
        results.append(solid.displacement.tobytes())
    assert len({*results}) == 1


def test_a_single_element_is_a_body():
    mesh = TetMesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.01, np.array([[0, 1, 2, 3]]))
    solid = free_solid(mesh)
    solid.displacement[1, 0] = 1e-3
    assert forces(solid)[1, 0] < 0.0
