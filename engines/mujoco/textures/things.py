"""Recipes of metal, plastic and cloth."""

from __future__ import annotations

import numpy as np

from engines.mujoco.textures.noise import Noise, Points
from engines.mujoco.textures.surface import Surface, blend

__all__ = ["brushed_steel", "drape", "plaster", "shaft_coat"]

_MM = 1e-3
_WEAVE = 1.0 * _MM
"""Distance of two threads of a drape."""


def brushed_steel(noise: Noise, points: Points) -> Surface:
    """Steel with scratches along y of the texture, and stains of handling."""
    along = points * np.array([1.0, 0.06, 1.0], np.float32)
    scratches, stains = noise.at(along, 0.06 * _MM, 0), noise.octaves(points, 2.0 * _MM, 1, 2)
    colour = np.full((len(points), 3), (0.66, 0.66, 0.68), np.float32)
    colour = colour * (np.float32(1.0) + 0.004 * scratches + 0.008 * stains)[:, None]
    roughness = np.float32(0.27) + np.float32(0.008) * scratches + np.float32(0.02) * stains
    return Surface(colour, np.float32(0.0004 * _MM) * scratches, roughness)


def drape(noise: Noise, points: Points) -> Surface:
    """Green surgical cloth: a plain weave."""
    x, y = points[:, 0] * np.float32(np.pi / _WEAVE), points[:, 1] * np.float32(np.pi / _WEAVE)
    weave = np.sin(x) * np.sin(y)
    broad = noise.octaves(points, 8.0 * _MM, 0, 3)
    colour = np.full((len(points), 3), (0.10, 0.36, 0.37), np.float32)
    colour = blend(colour, (0.16, 0.47, 0.47), 0.4 + 0.3 * broad)
    colour = colour * (np.float32(1.0) + 0.12 * weave)[:, None]
    return Surface(colour, np.float32(0.08 * _MM) * weave, np.full(len(points), 0.85, np.float32))


def plaster(noise: Noise, points: Points) -> Surface:
    """Grey wall of a room."""
    broad = noise.octaves(points, 0.05, 0, 3)
    colour = np.full((len(points), 3), (0.62, 0.64, 0.65), np.float32)
    colour = colour * (np.float32(1.0) + np.float32(0.02) * broad)[:, None]
    return Surface(colour, np.float32(1e-4) * broad, np.full(len(points), 0.9, np.float32))


def shaft_coat(noise: Noise, points: Points) -> Surface:
    """Matt black coat of a shaft, with a fine grain."""
    grain, wear = noise.at(points, 0.08 * _MM, 0), noise.octaves(points, 1.5 * _MM, 1, 2)
    colour = np.full((len(points), 3), (0.085, 0.085, 0.09), np.float32)
    colour = colour * (np.float32(1.0) + 0.06 * grain)[:, None]
    return Surface(colour, np.float32(0.002 * _MM) * grain, np.float32(0.42) + np.float32(0.06) * wear)
