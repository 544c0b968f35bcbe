import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.bullet.elasticity.stable_step import longest_step
from engines.tissue.frequencies import highest_frequency, lowest_frequency
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block
from tests.engines.bullet.finite_elements import energy, internal_forces

MATERIALS = st.builds(Material, st.floats(1e2, 1e6), st.floats(0.01, 0.495), st.just(1000.0), st.just(0.0))
CUBE = block(np.full(3, 0.02), 27)


@given(MATERIALS)
def test_lame_parameters(material):
    mu, lambda_ = material.lame
    assert mu * (3 * lambda_ + 2 * mu) / (lambda_ + mu) == pytest.approx(material.young_modulus)
    assert lambda_ / (2 * (lambda_ + mu)) == pytest.approx(material.poisson_ratio)


@given(MATERIALS, st.integers(0, 2**32 - 1))
def test_small_strains_of_the_neo_hookean_model_obey_hookes_law(material, seed):
    strain = np.random.default_rng(seed).uniform(-1e-5, 1e-5, (3, 3))
    strain = (strain + strain.T) / 2
    nodes = CUBE.nodes + CUBE.nodes @ strain
    forces = internal_forces(CUBE.nodes, CUBE.tetrahedra, nodes, *material.neo_hookean_lame)
    stress = -(forces.T @ CUBE.nodes) / 0.02**3  # virial theorem
    mu, lambda_ = material.lame
    np.testing.assert_allclose(
        stress,
        2 * mu * strain + lambda_ * np.trace(strain) * np.eye(3),
        atol=1e-4 * (2 * mu + lambda_) * 1e-5,
    )


def test_the_truth_is_the_derivative_of_its_energy():
    rng = np.random.default_rng(0)
    nodes = CUBE.nodes + rng.normal(0, 5e-4, CUBE.nodes.shape)
    direction = rng.normal(0, 1, CUBE.nodes.shape)
    h = 1e-8
    slope = (
        energy(CUBE.nodes, CUBE.tetrahedra, nodes + h * direction, 3e3, 2e4)
        - energy(CUBE.nodes, CUBE.tetrahedra, nodes - h * direction, 3e3, 2e4)
    ) / (2 * h)
    assert -np.sum(
        internal_forces(CUBE.nodes, CUBE.tetrahedra, nodes, 3e3, 2e4) * direction
    ) == pytest.approx(slope, rel=1e-6)


def frequencies(mesh, free, material):
    """Return all natural frequencies (rad/s) by differences of the truth."""
    moving = np.repeat(free, 3) > 0
    h, columns = 1e-9, []
    for i in np.flatnonzero(moving):
        moved = mesh.nodes.copy()
        moved.flat[i] += h
        columns.append(
            -internal_forces(mesh.nodes, mesh.tetrahedra, moved, *material.neo_hookean_lame).ravel()[moving]
            / h
        )
    return np.sqrt(
        np.linalg.eigvals(np.array(columns)).real / (material.density * mesh.volume / len(mesh.nodes))
    )


@pytest.mark.parametrize("poisson_ratio", [0.1, 0.4, 0.49])
def test_highest_frequency_against_all_frequencies(poisson_ratio):
    mesh = block(np.array([0.04, 0.03, 0.02]), 45)
    material = Material(1e4, poisson_ratio, 1000.0, 0.0)
    free = np.where(mesh.nodes[:, 2] > mesh.nodes[:, 2].min(), 1.0, 0.0)
    assert highest_frequency(mesh, free, material) == pytest.approx(
        frequencies(mesh, free, material).max(), rel=0.01
    )


def test_lowest_frequency_against_all_frequencies_of_a_beam():
    mesh = block(np.array([0.06, 0.015, 0.01]), 60)
    material = Material(1e4, 0.4, 1000.0, 0.0)
    free = np.where(mesh.nodes[:, 0] > mesh.nodes[:, 0].min(), 1.0, 0.0)
    lowest = frequencies(mesh, free, material).min()
    assert lowest * 0.999 < lowest_frequency(mesh, free, material) < 1.03 * lowest


@given(st.floats(10, 1e4), st.floats(0, 5e-3), st.floats(0.5, 2))
def test_longest_step_is_where_the_scheme_leaves_the_unit_circle(frequency, damping, ratio):
    h = ratio * (damping + np.sqrt(damping**2 + 4 / frequency**2))
    d = 1 / (1 + h * damping * frequency**2)
    radius = max(abs(np.roots([1, -(1 + d - d * h**2 * frequency**2), d])))
    if abs(ratio - 1) > 1e-6:
        assert (radius <= 1 + 1e-9) == (ratio < 1)
        if h * frequency < 4:
            assert (h < longest_step(frequency, damping)) == (ratio < 1)


@given(MATERIALS)
def test_contact_stiffness_grows_with_the_material_and_the_radius(material):
    assert material.contact_stiffness(0.01) == pytest.approx(2 * material.contact_stiffness(0.005))
    assert material.contact_stiffness(0.005) > 0.01 * material.young_modulus
