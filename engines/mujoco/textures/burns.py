"""Burnt patches painted on the outside of an organ: ragged edges, whatever the triangles below are."""

from __future__ import annotations

import numpy as np

from engines.mujoco.textures.atlas import Atlas
from engines.mujoco.textures.noise import Noise, Values
from engines.mujoco.textures.surface import Maps, smooth_step
from engines.mujoco.textures.tissues import char, coagulum
from schemas.vectors import Vector

__all__ = ["Burns"]

_GRAIN = 1.1e-3
"""Size of the notches of an edge, m."""
_RAGGED = 0.22
"""Width of the edge over which notches reach, as a share of a triangle."""
_PALE, _BLACK = (0.1, 0.75), (0.42, 0.6)
"""Share of burnt faces around a place at which tissue begins to be coagulated or charred, and is so."""


class Burns:
    """The maps of an outside with coagulum and char."""

    def __init__(self, atlas: Atlas, outside: Maps, noise: Noise) -> None:
        """`outside`: the maps of unburnt tissue."""
        self._atlas, self._outside = atlas, outside
        self._pale, self._black = atlas.paint(coagulum, noise), atlas.paint(char, noise)
        self._notches = atlas.at_texels(lambda points: noise.octaves(points, _GRAIN, 70, 3))

    def maps(self, coagulated: Vector, charred: Vector) -> Maps:
        """Return the maps for the shares of burnt, and of charred faces around each node at rest."""
        pale, black = (
            smooth_step(self._ragged(self._atlas.interpolate(share)), *limits)
            for share, limits in ((coagulated, _PALE), (charred, _BLACK))
        )
        burnt = np.flatnonzero((pale > 0.0) | (black > 0.0))
        pale, black = pale[burnt, None], black[burnt, None]
        found: list[np.ndarray] = []
        for outside, coagulum_map, char_map in zip(self._outside, self._pale, self._black, strict=True):
            pixels = outside.reshape(-1, 3).copy()
            mixed = pixels[burnt].astype(np.float32)
            mixed += pale * (coagulum_map.reshape(-1, 3)[burnt] - mixed)
            mixed += black * (char_map.reshape(-1, 3)[burnt] - mixed)
            pixels[burnt] = (mixed + np.float32(0.5)).astype(np.uint8)
            found.append(pixels.reshape(outside.shape))
        return Maps(*found)

    def _ragged(self, share: Values) -> Values:
        return share + np.float32(_RAGGED) * 4.0 * share * (1.0 - share) * self._notches
