"""Noise, recipes and the pictures made of them."""

from __future__ import annotations

import numpy as np
import pytest

from engines.mujoco.textures.noise import CELLS, Noise
from engines.mujoco.textures.surface import Recipe, Surface, make_maps, make_tile
from engines.mujoco.textures.things import brushed_steel, drape, plaster, shaft_coat
from engines.mujoco.textures.tissues import TISSUES, char, coagulum, cut_inside, tinted

NOISE = Noise(1)
RECIPES = [*TISSUES.values(), char, coagulum, cut_inside, brushed_steel, drape, plaster, shaft_coat]


def points(count: int = 500) -> np.ndarray:
    return np.random.default_rng(2).uniform(-0.05, 0.05, (count, 3)).astype(np.float32)


def test_noise_is_the_same_for_the_same_seed_smooth_and_periodic() -> None:
    somewhere, cell = points(), 2e-3
    values = NOISE.at(somewhere, cell)
    assert np.array_equal(values, Noise(1).at(somewhere, cell))
    assert not np.allclose(values, Noise(2).at(somewhere, cell))
    assert abs(float(values.mean())) < 0.15
    assert 0.5 < float(values.std()) < 1.1
    beside = NOISE.at(somewhere + np.float32(1e-5), cell)
    assert float(np.abs(beside - values).max()) < 0.1
    turned = NOISE.at(somewhere + np.float32(CELLS * cell), cell)
    assert np.allclose(turned, values, atol=2e-2)


@pytest.mark.parametrize("recipe", RECIPES)
def test_every_recipe_is_a_surface_with_some_life(recipe: Recipe) -> None:
    surface = recipe(NOISE, points())
    assert surface.colour.shape == (500, 3)
    assert surface.height.shape == surface.roughness.shape == (500,)
    assert float(surface.colour.min()) > -0.2
    assert float(surface.colour.max()) < 1.3
    assert float(surface.colour.std(axis=0).max()) > 0.003
    assert float(np.abs(surface.height).max()) < 3e-3


def test_a_tint_sets_the_mean_colour() -> None:
    surface = tinted(TISSUES["tissue"], (0.2, 0.8, 0.2))(NOISE, points())
    assert np.allclose(surface.colour.mean(axis=0), [0.2, 0.8, 0.2], atol=1e-3)


def test_normals_lean_away_from_a_slope() -> None:
    rising = np.tile(np.arange(8.0), 8) * 1e-3  # 1 mm for each texel of 1 mm, to the right
    maps = make_maps(Surface(np.ones((64, 3)), rising, np.full(64, 0.2)), (8, 8), 1e-3)
    x, y, z = maps.normal[4, 4] / 127.5 - 1.0
    assert x < -0.6
    assert abs(y) < 0.02
    assert z > 0.6
    assert maps.orm[4, 4].tolist() == [255, 51, 0]


def test_a_tile_has_no_seam() -> None:
    tile = make_tile(TISSUES["liver"], NOISE, 0.02, 64).colour.astype(float)
    inside = np.abs(np.diff(tile, axis=1)).mean()
    across = np.abs(tile[:, 0] - tile[:, -1]).mean()
    assert across < 2.0 * inside
