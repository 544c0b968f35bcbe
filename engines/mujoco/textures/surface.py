"""Surfaces at points of space, and the pictures of them that a renderer takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.textures.noise import Noise, Points, Values

__all__ = ["Colours", "Maps", "Pixels", "Recipe", "Surface", "blend", "make_maps", "make_tile", "smooth_step"]

Colours = NDArray[np.floating[Any]]
"""sRGB from 0 to 1, shape (n, 3)."""
Pixels = NDArray[np.uint8]
"""Shape (height, width, 3)."""

_STEEPEST = 3.0
"""Greatest slope of a bump."""
_MIXED = 5
"""A tile is mixed with its neighbour over a fifth of its side."""


class Surface(NamedTuple):
    """A surface at n points."""

    colour: Colours
    height: Values
    """Height of bumps, m."""
    roughness: Values
    """0: a mirror; 1: chalk. Wet tissue has 0.1 to 0.3."""


class Maps(NamedTuple):
    """Three pictures of a surface."""

    colour: Pixels
    """sRGB."""
    normal: Pixels
    """Normal in the tangent frame."""
    orm: Pixels
    """Occlusion, roughness and share of metal."""


Recipe = Callable[[Noise, Points], Surface]
"""Return the surface at points, shape (n, 3), m, in a body's rest shape."""


def make_maps(surface: Surface, shape: tuple[int, int], texel: float, *, metal: bool = False) -> Maps:
    """Return the maps of a surface at every texel, row by row; `texel`: its size, m."""
    height = surface.height.reshape(shape)
    down, right = ((np.roll(height, -1, axis) - np.roll(height, 1, axis)) / (2.0 * texel) for axis in (0, 1))
    slope = np.clip(np.stack([-right, -down], axis=-1), -_STEEPEST, _STEEPEST)
    normal = np.concatenate([slope, np.ones((*shape, 1))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    roughness = np.clip(surface.roughness, 0.04, 1.0).reshape(shape)
    ones = np.ones(shape)
    return Maps(
        _as_bytes(surface.colour.reshape(*shape, 3)),
        _as_bytes(0.5 + 0.5 * normal),
        _as_bytes(np.stack([ones, roughness, ones if metal else 0.0 * ones], axis=-1)),
    )


def make_tile(recipe: Recipe, noise: Noise, side: float, pixels: int, *, metal: bool = False) -> Maps:
    """Return square maps of a plane of `side`, m, without seams where they are repeated."""
    over = pixels // _MIXED
    full = pixels + over
    steps = np.arange(full, dtype=np.float32) * np.float32(side / pixels)
    grid = np.zeros((full, full, 3), np.float32)
    grid[..., 0], grid[..., 1] = steps, steps[:, None]
    found = recipe(noise, grid.reshape(-1, 3))
    mixed = (_wrapped(values.reshape(full, full, -1), over) for values in found)
    colour, height, roughness = (values.reshape(pixels * pixels, -1) for values in mixed)
    surface = Surface(colour, height[:, 0], roughness[:, 0])
    return make_maps(surface, (pixels, pixels), side / pixels, metal=metal)


def _wrapped(values: NDArray[np.floating[Any]], over: int) -> NDArray[np.floating[Any]]:
    """Return values without the last `over` rows and columns, which are mixed into the first ones."""
    share = np.linspace(0.0, 1.0, over, dtype=np.float32)[:, None, None]
    for _ in range(2):
        start = share * values[:over] + (1.0 - share) * values[-over:]
        values = np.concatenate([start, values[over:-over]]).swapaxes(0, 1)
    return values


def blend(first: Colours, second: tuple[float, float, float], share: Values) -> Colours:
    """Return colours, shape (n, 3), with a share of a second colour."""
    weight = np.clip(share, 0.0, 1.0)[:, None].astype(np.float32)
    return first + weight * (np.array(second, np.float32) - first)


def smooth_step(values: Values, low: float, high: float) -> Values:
    """Return 0 below `low`, 1 above `high`, and a smooth way between."""
    share = np.clip((values - np.float32(low)) / np.float32(high - low), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def _as_bytes(values: NDArray[np.floating[Any]]) -> Pixels:
    return np.ascontiguousarray(np.clip(values * 255.0 + 0.5, 0.0, 255.0).astype(np.uint8))
