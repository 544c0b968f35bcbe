"""A film of blood: nothing is lost, a plane against Nusselt, a bowl that fills, a ceiling that drips."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.fem.blood.film import BLOOD, QUANTUM, Film
from engines.tissue.meshing.grid import block
from robots import rotation

GRAVITY = 9.80665
STEP = 8e-3


def plane(columns, rows, size):
    """Return places and faces of a grid of right triangles in the plane z = 0, seen from above."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    places = size * np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    at = (x * rows + y)[:-1, :-1].ravel()
    lower = np.stack([at, at + rows, at + rows + 1], axis=1)
    upper = np.stack([at, at + rows + 1, at + 1], axis=1)
    return places, np.concatenate([lower, upper]).astype(np.int32)


def tilted(places, angle):
    """Turn about x, so that y rises."""
    turn = rotation.matrix(np.array([np.sin(0.5 * angle), 0.0, 0.0, np.cos(0.5 * angle)]))
    return np.ascontiguousarray(places @ turn.T)


@given(st.integers(0, 2**32 - 1))
def test_liquid_is_only_ever_moved(seed):
    random = np.random.default_rng(seed)
    mesh = block(np.array([0.03, 0.02, 0.01]), 120)
    turn = random.standard_normal(4)
    places = np.ascontiguousarray(mesh.nodes @ rotation.matrix(turn / np.linalg.norm(turn)).T)
    faces = mesh.triangles.astype(np.int32)
    faces[random.random(len(faces)) < 0.1] = -1
    film = Film(BLOOD, len(places), GRAVITY)
    on_faces = np.unique(faces[faces[:, 0] >= 0])
    film.amounts[on_faces] = random.integers(0, 10 ** random.integers(1, 13, len(on_faces)))
    total = int(film.amounts.sum())
    velocity = np.where(random.random(len(faces)) < 0.2, 1e-5, 0.0)
    for _ in range(60):
        rates, emitted = film.emit(faces, places, velocity, STEP)
        total += emitted
        total -= film.run(faces, places, STEP) + film.take(random.permutation(len(places))[:10], 10**9)
        assert emitted == pytest.approx(rates.sum() * STEP / QUANTUM, abs=3 * len(faces))
        assert film.amounts.min() >= 0
        assert int(film.amounts.sum()) == total


@pytest.mark.parametrize(("degrees", "flow"), [(30.0, 2e-7), (90.0, 2e-7), (60.0, 2e-6)])
def test_a_film_that_runs_down_a_plane_is_as_thick_as_nusselts(degrees, flow):
    size, rows = 2e-3, 30
    flat, faces = plane(9, rows, size)
    places = tilted(flat, np.radians(degrees))
    film = Film(BLOOD, len(places), GRAVITY)
    row = np.rint(flat[:, 1] / size).astype(int)
    inside = (flat[:, 0] > 0.0) & (flat[:, 0] < 8 * size - 1e-9)
    for _ in range(3000):
        width = np.where(inside, size, 0.5 * size)
        film.amounts[row == rows - 1] += (flow * STEP * width / QUANTUM).astype(np.int64)[row == rows - 1]
        film.run(faces, places, STEP)
        film.amounts[row == 0] = 0
    middle = inside & (row > 5) & (row < rows - 5)
    thickness = QUANTUM * film.amounts[middle] / size**2
    slope = np.sin(np.radians(degrees))
    nusselt = (3.0 * BLOOD.viscosity * flow / (BLOOD.density * GRAVITY * slope)) ** (1.0 / 3.0)
    assert thickness == pytest.approx(nusselt, rel=1e-4)


def test_a_bowl_fills_to_one_level():
    size = 2e-3
    places, faces = plane(15, 15, size)
    middle = places[:, :2].mean(axis=0)
    radius = np.linalg.norm(places[:, :2] - middle, axis=1)
    places[:, 2] = 8.0 * radius**2
    film = Film(BLOOD, len(places), GRAVITY)
    film.amounts[radius.argmin()] = int(0.2e-6 / QUANTUM)
    for _ in range(4000):
        assert film.run(faces, places, STEP) == 0
    steps = film.thickness(faces, places, 10e-6)
    pool = steps > 30
    level = places[pool, 2] + 10e-6 * steps[pool]
    assert 5 < pool.sum() < len(places)
    assert np.ptp(level) < 0.15e-3
    # volume of a paraboloid below its level: pi level^2 / (2 curvature)
    assert level.mean() == pytest.approx(np.sqrt(2.0 * 8.0 * 0.2e-6 / np.pi), rel=0.15)


def test_what_is_too_thick_drips_off_a_ceiling():
    places, faces = plane(6, 6, 2e-3)
    film = Film(BLOOD, len(places), GRAVITY)
    film.amounts[:] = int(1e-8 / QUANTUM)
    dripped = film.run(np.ascontiguousarray(faces[:, ::-1]), places, STEP)
    assert 0 < dripped < 36 * int(1e-8 / QUANTUM)
    steps = film.thickness(np.ascontiguousarray(faces[:, ::-1]), places, 10e-6)
    assert steps.max() == 50
    assert film.run(np.ascontiguousarray(faces[:, ::-1]), places, STEP) == 0
