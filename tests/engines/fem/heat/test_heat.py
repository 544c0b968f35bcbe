"""Heat in a body against closed forms: line source, perfusion, damage, boiling, conserved heat, cuts."""

from dataclasses import replace
from math import exp, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import exp1

from engines.fem.heat.heat import Heat
from engines.fem.heat.tissue import BODY, TISSUES
from engines.tissue.meshing.grid import grid_indices, tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import TetMesh, volumes
from schemas.soft_surface import FaceKind

LIVER = TISSUES["liver"]
BLOODLESS = replace(LIVER, perfusion=0.0)
DIFFUSIVITY = LIVER.conductivity / LIVER.capacity
LATENT = LIVER.density * LIVER.water / LIVER.steam_per_joule
GAS = 8.314463


def grid(cells, edge):
    """Return a block of cubic cells with its middle at the origin."""
    points = edge * (grid_indices(*(n + 1 for n in cells)) - 0.5 * np.array(cells))
    return TetMesh(points, tetrahedra_of_cells(cells))


def elements(mesh):
    edges = mesh.nodes[mesh.tetrahedra[:, 1:]] - mesh.nodes[mesh.tetrahedra[:, :1]]
    gradients = np.linalg.inv(edges).transpose(0, 2, 1).reshape(-1, 9)
    return mesh.tetrahedra, gradients, volumes(mesh.nodes, mesh.tetrahedra)


def heat_of(mesh, tissue=BLOODLESS):
    return Heat([tissue], *elements(mesh), len(mesh.nodes))


def everywhere(heat, watts):
    """Return a power in proportion to the volumes."""
    return (watts / heat._volume.sum() * heat._volume).astype(np.float32)


def test_a_line_source_in_an_infinite_body():
    """Carslaw, Jaeger, Conduction of Heat in Solids (1959), section 10.4: an exponential integral."""
    mesh, watts_per_m, seconds = grid((80, 2, 80), 5e-4), 60.0, 60.0
    heat = heat_of(mesh)
    on_line = np.abs(mesh.nodes[:, [0, 2]]).max(axis=1) < 1e-9
    touched = on_line[mesh.tetrahedra].sum(axis=1)
    power = (watts_per_m * 1e-3 * touched / touched.sum()).astype(np.float32)
    for _ in range(30):
        heat.advance(seconds / 30.0, power)
    distance = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 2])
    near = (distance > 2.5e-3) & (distance < 6.5e-3)
    truth = (
        watts_per_m
        / (4.0 * pi * LIVER.conductivity)
        * exp1(distance[near] ** 2 / (4.0 * DIFFUSIVITY * seconds))
    )
    assert truth.min() > 0.2
    np.testing.assert_allclose(heat.rise[near], truth, rtol=0.05)


def test_a_flux_into_a_half_space():
    """Carslaw, Jaeger, section 2.9: 2 q sqrt(t / (pi k rho c)) at the surface."""
    mesh, flux, seconds = grid((2, 2, 80), 1e-4), 5e3, 10.0
    heat = heat_of(mesh)
    top = mesh.nodes[:, 2] > 4e-3 - 1e-9
    touched = top[mesh.tetrahedra].sum(axis=1)
    heat.advance(seconds, (flux * 4e-8 * touched / touched.sum()).astype(np.float32))
    truth = 2.0 * flux * sqrt(seconds / (pi * LIVER.conductivity * LIVER.capacity))
    assert heat.rise[top].mean() == pytest.approx(truth, rel=0.05)


def test_blood_carries_heat_away():
    heat = heat_of(grid((4, 4, 4), 1e-3), LIVER)
    heat.rise[:] = 4.0
    heat.book[4] = 4.0
    heat.advance(20.0)
    rate = LIVER.constants[2] / LIVER.capacity
    assert 1.0 / rate == pytest.approx(65.0, rel=0.01)
    np.testing.assert_allclose(heat.rise, 4.0 * exp(-20.0 * rate), rtol=1e-2)


@pytest.mark.parametrize(
    ("celsius", "seconds", "times"),
    [(50.0, 10.0, (1007, 61)), (60.0, 2.0, (44, 3.4)), (70.0, 0.1, (2.3, 0.23))],
)
def test_damage_at_a_constant_temperature(celsius, seconds, times):
    heat = heat_of(grid((2, 2, 2), 1e-3))
    heat.rise[:] = celsius - BODY
    heat.book[4] = celsius - BODY
    for _ in range(10):
        heat.advance(seconds / 10.0)
    for damage, (log_factor, temperature), time in zip(
        heat.damage, LIVER.constants[11:].reshape(2, 2), times, strict=True
    ):
        np.testing.assert_allclose(
            damage, seconds * exp(log_factor - temperature / (celsius + 273.15)), rtol=1e-5
        )
        np.testing.assert_allclose(damage, seconds / time, rtol=0.1)


def test_a_body_at_its_own_temperature_takes_no_damage_and_no_time():
    heat = heat_of(grid((4, 4, 4), 1e-3), LIVER)
    heat._compiled = None  # a step would fail
    assert heat.is_cold
    assert heat.advance(3600.0) == 0.0
    assert not heat.damage.any()


def test_a_cutting_current_takes_tissue_as_soon_as_it_is_dry():
    heat = heat_of(grid((2, 2, 2), 1e-3))
    volume, power = 8e-9, everywhere(heat, 2.0)
    bursts = np.ones(len(power), np.bool_)
    while len(heat.vaporised()) < len(heat.stage):
        heat.advance(1e-2, power, bursts)
    needed = volume * (LIVER.capacity * 63.0 + LATENT)
    assert heat.book[0] == pytest.approx(needed, rel=0.02)
    assert needed / volume == pytest.approx(2.0e9, rel=0.05)  # 1.9 to 2.1 J/mm^3
    assert heat.imbalance == pytest.approx(0.0, abs=1e-5 * heat.book[0])


def test_water_boils_off_at_100_degrees_with_its_latent_heat():
    heat = heat_of(grid((2, 2, 2), 1e-3))
    volume, watts = 8e-9, 2.0
    power = everywhere(heat, watts)
    to_boiling = LIVER.capacity * 63.0 * volume / watts
    to_dry = LATENT * volume / watts
    heat.advance(to_boiling, power)
    np.testing.assert_allclose(heat.temperature, 100.0, atol=2.0)
    smoke = sum(heat.advance(0.005 * to_dry, power) for _ in range(100))
    np.testing.assert_allclose(heat.temperature, 100.0, atol=0.01)
    np.testing.assert_allclose(heat.water, 0.5, atol=0.03)
    assert smoke == pytest.approx(0.5 * LIVER.density * LIVER.water * volume, rel=0.05)
    assert smoke == pytest.approx(heat.book[2] / 2.257e6, rel=1e-6)
    assert not heat.kinds[heat.damage[0] < 1.0].any()
    assert (heat.kinds == FaceKind.COAGULATED).all()
    while not heat.stage.all():
        smoke += heat.advance(0.005 * to_dry, power)
    assert (heat.kinds == FaceKind.CHARRED).all()
    while len(heat.vaporised()) < len(heat.stage):
        smoke += heat.advance(0.005 * to_dry, power)
    assert smoke == pytest.approx(LIVER.density * volume, rel=1e-3)
    assert heat.imbalance == pytest.approx(0.0, abs=1e-5 * heat.book[0])


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 100.0))
def test_heat_is_conserved_and_finite(seed, watts):
    random = np.random.default_rng(seed)
    mesh = grid((4, 4, 4), 1e-3)
    heat = heat_of(mesh, LIVER if seed % 2 else BLOODLESS)
    for _ in range(100):
        power = random.uniform(0.0, 1.0, len(heat.stage)) * (random.uniform(0.0, 1.0, len(heat.stage)) < 0.1)
        heat.advance(0.01, (watts * power / power.sum()).astype(np.float32))
    for _ in range(100):
        heat.advance(0.01)
    assert abs(heat.imbalance) < 1e-5 * heat.book[0]
    assert all(np.isfinite(array).all() for array in heat.state)
    assert heat.rise.min() > -0.1 * heat.rise.max()


def test_a_sliver_costs_no_more_than_ten_sub_steps():
    mesh = grid((2, 2, 2), 1e-3)
    mesh.nodes[13] = mesh.nodes[12] + [1e-9, 1e-7, 1e-7]
    heat = heat_of(TetMesh(mesh.nodes, mesh.tetrahedra[volumes(mesh.nodes, mesh.tetrahedra) > 0.0]))
    for _ in range(100):
        heat.advance(0.01, everywhere(heat, 1.0))
    assert heat._rate < 1.001e3
    assert np.isfinite(heat.rise).all()
    assert abs(heat.imbalance) < 1e-5 * heat.book[0]


def test_no_heat_crosses_an_opened_face():
    mesh = grid((4, 2, 2), 1e-3)
    heat = heat_of(mesh)
    corners, gradients, volume = elements(mesh)
    left = mesh.nodes[corners].mean(axis=1)[:, 0] < 0.0
    warm = (everywhere(heat, 0.5) * left).astype(np.float32)
    heat.advance(0.5, warm)
    before = heat.stored
    on_cut = np.flatnonzero(np.abs(mesh.nodes[:, 0]) < 1e-9)
    copies = np.arange(len(mesh.nodes))
    copies[on_cut] = len(mesh.nodes) + np.arange(len(on_cut))
    heat.rebind(np.where(left[:, None], corners, copies[corners]), gradients, volume)
    assert heat.stored == pytest.approx(before, rel=1e-6)
    right = np.unique(heat._corners[~left])
    kept = float(heat._capacity[right].astype(float) @ heat.rise[right])
    heat.advance(20.0, warm)
    assert float(heat._capacity[right].astype(float) @ heat.rise[right]) == pytest.approx(kept, rel=1e-5)
    assert heat.rise[heat._corners[left]].min() > heat.rise[right].max()


def test_a_node_parted_twice_is_as_warm_as_the_node_in_whose_place_it_stands():
    mesh = grid((3, 1, 1), 1e-3)
    heat = heat_of(mesh)
    corners, gradients, volume = elements(mesh)
    node = int(np.bincount(corners.ravel()).argmax())
    where = corners == node
    rows = np.flatnonzero(where.any(axis=1))
    assert len(rows) > 2
    for count, kept in ((1, rows[:1]), (2, rows[:2])):
        parted = where.copy()
        parted[kept] = False
        corners = np.where(parted, len(mesh.nodes) - 1 + count, corners)
        heat.rebind(corners, gradients, volume)
        assert heat.rise[-1] == (0.0 if count == 1 else 50.0)
        heat.rise[-1] = 50.0
    assert heat.rise[node] == 0.0
    assert len(heat.rise) == len(mesh.nodes) + 2


def test_an_element_that_goes_carries_its_heat_away():
    mesh = grid((2, 2, 2), 1e-3)
    heat = heat_of(mesh)
    heat.advance(1.0, everywhere(heat, 1.0))
    corners, gradients, volume = elements(mesh)
    volume[:5] = 0.0
    heat.rebind(corners, gradients, volume)
    heat.advance(0.1)
    assert heat.book[6] > 0.0
    assert abs(heat.imbalance) < 1e-5 * heat.book[0]
    corners, gradients, volume = elements(mesh)
    heat.rebind(corners, gradients, 0.0 * volume)
    assert heat.stored == 0.0
    heat.advance(0.1)
    assert heat.hottest == BODY, "nothing that is left is warm"


def test_a_state_goes_on_to_the_bit():
    heat = heat_of(grid((4, 4, 4), 1e-3), LIVER)
    power = np.zeros(len(heat.stage), np.float32)
    power[100:110] = 1.0
    for _ in range(100):
        heat.advance(0.01, power)
    saved, ends = [array.copy() for array in heat.state], []
    for _ in range(2):
        for array, value in zip(heat.state, saved, strict=True):
            array[...] = value
        for _ in range(50):
            heat.advance(0.01, power)
        ends.append(b"".join(array.tobytes() for array in heat.state))
    assert ends[0] == ends[1]
