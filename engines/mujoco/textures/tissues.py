"""Recipes of living tissue, for a white lamp: pigment mottled by blood, vessels, fat, and a wet film.

Colours: reflectances of tissue with its share of blood under white light, then by eye. Gloss: a wet film
reflects as a roughness of 0.1 to 0.25, burnt tissue as 0.5 to 0.8. Sizes: hepatic lobules 1 to 2 mm, fat
lobules 3 to 6 mm, serosal vessels 0.1 to 1 mm.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from engines.mujoco.textures.noise import Noise, Points, Values
from engines.mujoco.textures.surface import Colours, Recipe, Surface, blend, smooth_step

__all__ = ["TISSUES", "areolar", "char", "coagulum", "cut_inside", "cut_wall", "fatty_peritoneum", "tinted"]

_MM = 1e-3
_VESSEL, _VEIN = (0.50, 0.10, 0.09), (0.40, 0.17, 0.24)
_FAT = (0.91, 0.76, 0.50)


def _base(points: Points, colour: tuple[float, float, float]) -> Colours:
    return np.broadcast_to(np.array(colour, np.float32), (len(points), 3))


def _mottled(colour: Colours, *layers: Values) -> Colours:
    total = np.float32(1.0) + sum(layers, np.zeros(len(colour), np.float32))
    return colour * total[:, None]


def _vessels(noise: Noise, points: Points, cell: float, width: float, channel: int, share: float) -> Values:
    """Return 1 on vessels; `share`: of the surface that has some."""
    bends = np.stack([noise.at(points, 0.6 * cell, channel + k) for k in (1, 2, 3)], axis=1)
    where = smooth_step(noise.at(points, 2.5 * cell, channel + 4), 1.0 - 2.0 * share, 1.6 - 2.0 * share)
    return where * noise.lines(points + np.float32(0.25 * cell) * bends, cell, width, channel)


def _wet(noise: Noise, points: Points, mean: float, channel: int = 90) -> Values:
    """Return the roughness of a film that is thinner here and there."""
    return np.float32(mean) + np.float32(0.35 * mean) * noise.octaves(points, 3.0 * _MM, channel, 2)


def _liver(noise: Noise, points: Points) -> Surface:
    broad, lobules = noise.octaves(points, 16.0 * _MM, 0, 2), noise.at(points, 0.45 * _MM, 5)
    middle = noise.at(points, 2.5 * _MM, 6)
    colour = blend(_base(points, (0.445, 0.24, 0.19)), (0.375, 0.188, 0.152), 0.5 + 0.3 * broad)
    colour = blend(colour, (0.56, 0.37, 0.29), 0.12 * smooth_step(noise.at(points, 6.0 * _MM, 7), 0.5, 1.8))
    colour = _mottled(colour, 0.055 * lobules, 0.025 * middle)
    height = 0.015 * _MM * middle + 0.005 * _MM * lobules + 0.2 * _MM * noise.at(points, 8.0 * _MM, 8)
    return Surface(colour, height, _wet(noise, points, 0.36))


def _kidney(noise: Noise, points: Points) -> Surface:
    broad, fine = noise.octaves(points, 12.0 * _MM, 0, 3), noise.at(points, 0.8 * _MM, 5)
    colour = blend(_base(points, (0.56, 0.29, 0.25)), (0.43, 0.19, 0.17), 0.5 + 0.5 * broad)
    colour = blend(colour, _VESSEL, 0.35 * _vessels(noise, points, 7.0 * _MM, 0.12, 10, 0.5))
    height = 0.2 * _MM * noise.at(points, 6.0 * _MM, 8) + 0.015 * _MM * fine
    bare = Surface(_mottled(colour, 0.05 * fine), height, _wet(noise, points, 0.19))
    return _with_fat(noise, points, bare, smooth_step(noise.octaves(points, 16.0 * _MM, 20, 2), 1.0, 1.4))


def _gallbladder(noise: Noise, points: Points) -> Surface:
    broad, fine = noise.octaves(points, 14.0 * _MM, 0, 3), noise.at(points, 0.7 * _MM, 5)
    colour = blend(_base(points, (0.40, 0.43, 0.345)), (0.53, 0.49, 0.37), 0.45 + 0.5 * broad)
    colour = blend(colour, (0.33, 0.385, 0.36), 0.5 * smooth_step(noise.at(points, 11.0 * _MM, 21), 0.2, 1.5))
    flushed = smooth_step(noise.octaves(points, 9.0 * _MM, 22, 2), 0.6, 1.7)
    colour = blend(colour, (0.62, 0.44, 0.38), 0.45 * flushed)
    fat = smooth_step(noise.octaves(points, 8.0 * _MM, 20, 3), 1.0, 2.2)
    colour = blend(colour, _FAT, 0.55 * fat)
    colour = blend(colour, _VESSEL, 0.40 * _vessels(noise, points, 7.0 * _MM, 0.03, 10, 0.55))
    colour = blend(colour, _VESSEL, 0.38 * _vessels(noise, points, 2.4 * _MM, 0.06, 30, 0.6))
    colour = blend(colour, _VEIN, 0.25 * _vessels(noise, points, 1.2 * _MM, 0.10, 50, 0.5))
    height = 0.15 * _MM * noise.at(points, 5.0 * _MM, 8) + 0.012 * _MM * fine + 0.35 * _MM * fat
    return Surface(_mottled(colour, 0.03 * fine), height, _wet(noise, points, 0.12))


def _duct(noise: Noise, points: Points) -> Surface:
    """Bile duct: pale with a tint of bile, in loose fibres."""
    broad, fine = noise.octaves(points, 5.0 * _MM, 0, 3), noise.at(points, 0.4 * _MM, 5)
    colour = blend(_base(points, (0.78, 0.69, 0.53)), (0.70, 0.59, 0.41), 0.45 + 0.5 * broad)
    colour = blend(colour, (0.86, 0.80, 0.68), 0.5 * noise.lines(points, 1.6 * _MM, 0.25, 6))
    colour = blend(colour, (0.74, 0.50, 0.40), 0.5 * smooth_step(noise.at(points, 3.0 * _MM, 7), 0.5, 1.8))
    colour = blend(colour, _VESSEL, 0.45 * _vessels(noise, points, 2.2 * _MM, 0.07, 10, 0.6))
    height = 0.10 * _MM * noise.at(points, 1.4 * _MM, 8) + 0.012 * _MM * fine
    return Surface(_mottled(colour, 0.04 * fine), height, _wet(noise, points, 0.2))


def _artery(noise: Noise, points: Points) -> Surface:
    """Artery in its sheath: pink, with pale fibres and fine vessels of its own."""
    broad, fine = noise.octaves(points, 4.0 * _MM, 0, 3), noise.at(points, 0.4 * _MM, 5)
    colour = blend(_base(points, (0.70, 0.39, 0.34)), (0.58, 0.24, 0.21), 0.4 + 0.5 * broad)
    colour = blend(colour, (0.84, 0.66, 0.58), 0.55 * noise.lines(points, 1.5 * _MM, 0.25, 6))
    colour = blend(colour, _VESSEL, 0.5 * _vessels(noise, points, 1.8 * _MM, 0.08, 10, 0.6))
    height = 0.08 * _MM * noise.at(points, 1.2 * _MM, 8) + 0.012 * _MM * fine
    return Surface(_mottled(colour, 0.04 * fine), height, _wet(noise, points, 0.2))


def areolar(noise: Noise, points: Points) -> Surface:
    """Loose tissue where organs join: peritoneum, fat in strands, torn fibres."""
    bends = np.stack([noise.at(points, 1.5 * _MM, 40 + k) for k in range(3)], axis=1)
    depth, number = noise.lobules(points + np.float32(0.6 * _MM) * bends, 2.6 * _MM)
    full, fine = smooth_step(depth, -0.1, 0.6), noise.at(points, 0.4 * _MM, 5)
    colour = blend(_base(points, (0.74, 0.49, 0.38)), (0.84, 0.66, 0.45), 0.3 + 0.7 * full)
    colour = blend(colour, (0.90, 0.77, 0.62), 0.9 * (number - 0.3) * full)
    colour = blend(colour, (0.72, 0.38, 0.32), 0.5 * smooth_step(noise.at(points, 4.0 * _MM, 7), 0.4, 1.6))
    colour = blend(colour, _VESSEL, 0.45 * _vessels(noise, points, 2.4 * _MM, 0.07, 10, 0.5))
    height = 0.30 * _MM * full + 0.012 * _MM * fine
    return Surface(_mottled(colour, 0.03 * fine), height, _wet(noise, points, 0.2))


def _bowel(noise: Noise, points: Points) -> Surface:
    broad, fine = noise.octaves(points, 10.0 * _MM, 0, 3), noise.at(points, 0.6 * _MM, 5)
    colour = blend(_base(points, (0.88, 0.61, 0.54)), (0.80, 0.46, 0.41), 0.35 + 0.45 * broad)
    across = points * np.array([0.4, 1.0, 1.0], np.float32)
    colour = blend(colour, _VESSEL, 0.55 * _vessels(noise, across, 6.0 * _MM, 0.05, 10, 0.6))
    colour = blend(colour, _VEIN, 0.35 * _vessels(noise, across, 2.6 * _MM, 0.08, 30, 0.6))
    height = 0.12 * _MM * noise.at(points, 4.0 * _MM, 8) + 0.01 * _MM * fine
    return Surface(_mottled(colour, 0.03 * fine), height, _wet(noise, points, 0.15))


def _colon(noise: Noise, points: Points) -> Surface:
    deposits = smooth_step(noise.octaves(points, 15.0 * _MM, 20, 2), 1.25, 1.6)
    return _with_fat(noise, points, _bowel(noise, points), deposits)


def _with_fat(noise: Noise, points: Points, bare: Surface, share: Values) -> Surface:
    """Return a surface with deposits of fat; `share`: 1 in a deposit, 0 beside."""
    fat = _fat(noise, points)
    mixed = bare.colour + (0.92 * share)[:, None] * (fat.colour - bare.colour)
    return Surface(mixed, bare.height + share * (0.9 * _MM + fat.height), bare.roughness)


def _fat(noise: Noise, points: Points) -> Surface:
    bends = np.stack([noise.at(points, 2.5 * _MM, 40 + k) for k in range(3)], axis=1)
    depth, number = noise.lobules(points + np.float32(0.7 * _MM) * bends, 4.5 * _MM)
    lobe, _ = noise.lobules(points + np.float32(3.0 * _MM) * bends, 17.0 * _MM)
    fold = smooth_step(lobe, 0.0, 0.6)
    full, broad = smooth_step(depth, -0.1, 0.6), noise.octaves(points, 12.0 * _MM, 6, 2)
    fine = noise.at(points, 0.5 * _MM, 5)
    colour = blend(_base(points, (0.88, 0.68, 0.43)), (0.95, 0.80, 0.54), 0.35 + 0.65 * full)
    colour = blend(colour, (0.97, 0.88, 0.68), 1.0 * (number - 0.25) * full)
    colour = blend(colour, (0.90, 0.58, 0.46), 0.4 * smooth_step(broad, 0.2, 1.6))
    colour = blend(colour, (0.86, 0.56, 0.40), 0.45 * (1.0 - fold))
    colour = blend(colour, _VESSEL, 0.45 * _vessels(noise, points, 9.0 * _MM, 0.035, 10, 0.4))
    colour = blend(colour, _VESSEL, 0.25 * _vessels(noise, points, 3.0 * _MM, 0.06, 30, 0.35))
    height = 0.25 * _MM * full + 0.6 * _MM * fold + 0.012 * _MM * fine
    return Surface(_mottled(colour, 0.02 * fine), height, _wet(noise, points, 0.19))


def _peritoneum(noise: Noise, points: Points) -> Surface:
    broad, fine = noise.octaves(points, 20.0 * _MM, 0, 3), noise.at(points, 1.0 * _MM, 5)
    colour = blend(_base(points, (0.80, 0.52, 0.45)), (0.66, 0.31, 0.27), 0.45 + 0.5 * broad)
    fat = smooth_step(noise.octaves(points, 24.0 * _MM, 20, 2), 0.6, 1.2)
    colour = blend(colour, _FAT, 0.55 * fat)
    colour = blend(colour, _VESSEL, 0.70 * _vessels(noise, points, 14.0 * _MM, 0.05, 10, 0.7))
    colour = blend(colour, _VEIN, 0.40 * _vessels(noise, points, 5.0 * _MM, 0.08, 30, 0.5))
    height = 0.3 * _MM * noise.at(points, 6.0 * _MM, 8) + 0.03 * _MM * fine
    return Surface(_mottled(colour, 0.04 * fine), height, _wet(noise, points, 0.2))


def fatty_peritoneum(noise: Noise, points: Points) -> Surface:
    """Peritoneum over fat, pink where the fat is thin."""
    fat, bare = areolar(noise, points), _peritoneum(noise, points)
    thin = smooth_step(noise.octaves(points, 9.0 * _MM, 65, 3), -0.9, 1.1)
    colour = bare.colour + (0.15 + 0.6 * thin)[:, None] * (fat.colour * np.float32(0.92) - bare.colour)
    height = 0.6 * bare.height + (0.3 + 0.5 * thin) * fat.height
    return Surface(colour, height, _wet(noise, points, 0.17))


def _muscle(noise: Noise, points: Points) -> Surface:
    along = points * np.array([0.12, 1.0, 1.0], np.float32)
    fibres, bundles = noise.at(along, 0.45 * _MM, 0), noise.at(along, 1.8 * _MM, 1)
    colour = blend(_base(points, (0.62, 0.22, 0.18)), (0.45, 0.12, 0.11), 0.5 + 0.45 * bundles)
    colour = blend(colour, (0.85, 0.68, 0.58), 0.4 * noise.lines(along, 2.6 * _MM, 0.12, 2))
    height = 0.06 * _MM * fibres + 0.15 * _MM * bundles
    return Surface(_mottled(colour, 0.07 * fibres), height, _wet(noise, points, 0.19))


def _tissue(noise: Noise, points: Points) -> Surface:
    broad, fine = noise.octaves(points, 11.0 * _MM, 0, 3), noise.at(points, 0.7 * _MM, 5)
    colour = blend(_base(points, (0.80, 0.43, 0.37)), (0.63, 0.26, 0.23), 0.45 + 0.5 * broad)
    colour = blend(colour, _VESSEL, 0.65 * _vessels(noise, points, 8.0 * _MM, 0.06, 10, 0.65))
    colour = blend(colour, _VEIN, 0.40 * _vessels(noise, points, 3.0 * _MM, 0.10, 30, 0.5))
    height = 0.2 * _MM * noise.at(points, 4.5 * _MM, 8) + 0.02 * _MM * fine
    return Surface(_mottled(colour, 0.05 * fine), height, _wet(noise, points, 0.16))


def _skin(noise: Noise, points: Points) -> Surface:
    """Silicone of a training pad: even colour, pores and fine creases, hardly wet."""
    broad, pores = noise.octaves(points, 16.0 * _MM, 0, 2), noise.at(points, 0.45 * _MM, 5)
    creases = noise.lines(points, 1.6 * _MM, 0.2, 6)
    colour = blend(_base(points, (0.88, 0.66, 0.54)), (0.82, 0.55, 0.45), 0.5 + 0.4 * broad)
    colour = _mottled(colour, 0.025 * pores, -0.05 * creases)
    height = 0.02 * _MM * pores - 0.03 * _MM * creases
    return Surface(colour, height, np.float32(0.42) + np.float32(0.08) * noise.at(points, 4.0 * _MM, 9))


def cut_inside(noise: Noise, points: Points) -> Surface:
    """Inside of a cut: raw, bloody, wet."""
    broad, grain = noise.octaves(points, 4.0 * _MM, 0, 3), noise.at(points, 0.5 * _MM, 5)
    colour = blend(_base(points, (0.57, 0.16, 0.135)), (0.37, 0.05, 0.05), 0.45 + 0.5 * broad)
    colour = blend(colour, (0.78, 0.46, 0.37), 0.45 * smooth_step(grain, 0.8, 1.8))
    height = 0.15 * _MM * noise.at(points, 1.5 * _MM, 8) + 0.05 * _MM * grain
    return Surface(colour, height, _wet(noise, points, 0.13))


def cut_wall(noise: Noise, points: Points) -> Surface:
    """Cut through the wall of a duct or an artery: pale, with a little blood."""
    broad, grain = noise.octaves(points, 1.5 * _MM, 0, 3), noise.at(points, 0.3 * _MM, 5)
    colour = blend(_base(points, (0.74, 0.56, 0.46)), (0.62, 0.30, 0.26), 0.3 + 0.5 * broad)
    height = 0.08 * _MM * broad + 0.03 * _MM * grain
    return Surface(_mottled(colour, 0.05 * grain), height, _wet(noise, points, 0.16))


def coagulum(noise: Noise, points: Points) -> Surface:
    """Coagulum: pale, dry, shrunken."""
    broad, grain = noise.octaves(points, 3.0 * _MM, 0, 3), noise.at(points, 0.6 * _MM, 5)
    colour = blend(_base(points, (0.85, 0.77, 0.64)), (0.68, 0.50, 0.36), 0.35 + 0.4 * broad)
    height = 0.2 * _MM * broad + 0.05 * _MM * grain
    return Surface(_mottled(colour, 0.06 * grain), height, np.float32(0.55) + np.float32(0.08) * grain)


def char(noise: Noise, points: Points) -> Surface:
    """Char: black crust with cracks."""
    cracks, grain = noise.lines(points, 1.2 * _MM, 0.25, 1), noise.at(points, 0.4 * _MM, 5)
    colour = blend(_base(points, (0.10, 0.075, 0.065)), (0.24, 0.11, 0.08), 0.6 * cracks)
    height = 0.08 * _MM * grain - 0.15 * _MM * cracks
    return Surface(_mottled(colour, 0.25 * grain), height, np.float32(0.75) + np.float32(0.1) * grain)


TISSUES: Mapping[str, Recipe] = {
    "adrenal": _fat,
    "artery": _artery,
    "bowel": _bowel,
    "colon": _colon,
    "duct": _duct,
    "fat": _fat,
    "gallbladder": _gallbladder,
    "kidney": _kidney,
    "liver": _liver,
    "muscle": _muscle,
    "peritoneum": _peritoneum,
    "skin": _skin,
    "tissue": _tissue,
}
"""Recipes by the name of a tissue."""


def tinted(recipe: Recipe, rgb: tuple[float, float, float]) -> Recipe:
    """Return `recipe` with `rgb` as the mean colour."""

    def surface(noise: Noise, points: Points) -> Surface:
        found = recipe(noise, points)
        mean = np.maximum(found.colour.mean(axis=0), 1e-3)
        return found._replace(colour=found.colour * (np.array(rgb, np.float32) / mean))

    return surface
