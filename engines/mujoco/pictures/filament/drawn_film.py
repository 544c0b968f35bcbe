"""Liquid on a soft body as the physically based renderer draws it: a clear, shining coat over the faces."""

from __future__ import annotations

import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.pictures.filament.drawn_coat import DrawnCoat
from engines.mujoco.textures.surface import Pixels
from hub.participant.view import tint_of
from schemas.soft_surface import FILM_STEP_M
from schemas.vectors import Vector

__all__ = ["DrawnFilm"]

_STEPS = 256
"""Thicknesses of a film, in `FILM_STEP_M`."""
_LEAST = 0.1
"""Least thickness that is drawn, in steps."""
_LIFT = 1.0e-4
"""Distance of the coat from the faces, m, so that it is not in them."""
_ROUGHNESS = 0.08
_DEEP = 0.3
"""Reflectance of a deep pool over the number of a screen's colour."""
_ROUNDS = 2
"""Passes that round the edge of a pool, which is one of triangles."""


class DrawnFilm:
    """The liquid on one mesh of a soft body."""

    def __init__(
        self, context: mjrf.Context, scene: mjrf.Scene, liquid: str, faces: NDArray[np.uint32], below: Vector
    ) -> None:
        """Prepare a film for `faces`, drawn vertices of shape (m, 3).

        `below`: mean colour of the tissue, sRGB from 0 to 1, shape (3,).
        """
        self._faces, self._around = faces, np.maximum(np.bincount(faces.ravel()), 1)
        self._coat = DrawnCoat(context, scene, faces, _coat_colours(liquid, below), _ROUGHNESS)

    def update(self, vertices: NDArray[np.float32], steps: Vector) -> None:
        """Show the liquid.

        Args:
            vertices: as drawn, with tangent frames, shape (n, 9).
            steps: thickness at each vertex, in `FILM_STEP_M`, shape (n,).
        """
        if not steps.any():
            self._coat.hide()
            return
        steps = self._rounded(steps)
        uv = np.full((len(steps), 2), 0.5, np.float32)
        uv[:, 0] = (np.minimum(steps, _STEPS - 1) + 0.5) / _STEPS
        is_wet = np.asarray((steps[self._faces] >= _LEAST).any(axis=1))
        self._coat.show(vertices, uv, (_LIFT + FILM_STEP_M * steps).astype(np.float32), is_wet)

    def _rounded(self, steps: Vector) -> Vector:
        """Return values at the vertices, each drawn towards those of the faces around."""
        for _ in range(_ROUNDS):
            mean = steps[self._faces].mean(axis=1).repeat(3)
            steps = np.bincount(self._faces.ravel(), mean, len(steps)) / self._around
        return steps

    def hide(self) -> None:
        """Show no liquid."""
        self._coat.hide()


def _coat_colours(liquid: str, below: Vector) -> Pixels:
    """Return colour and opacity over the thickness of a film, shape (1, 256, 4).

    A coat has one opacity for all colours: that of the colour which the liquid takes away most. So the coat
    brings back, of the light that tissue `below` reflects, the colours that the liquid lets through.
    """
    tint = tint_of(liquid)
    through = np.exp(-FILM_STEP_M * np.arange(_STEPS)[:, None] / np.array(tint.depth_m))
    opacity = 1.0 - through.min(axis=1, keepdims=True)
    light = (through - (1.0 - opacity)) * below**2.2 + (1.0 - through) * _DEEP * np.array(tint.deep)
    colours = np.concatenate([(light / np.maximum(opacity, 1e-6)) ** (1.0 / 2.2), opacity], axis=1)
    return np.rint(255.0 * np.clip(colours, 0.0, 1.0)).astype(np.uint8)[None]
