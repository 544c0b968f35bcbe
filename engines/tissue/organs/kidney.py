"""A kidney with adrenal gland."""

from __future__ import annotations

import numpy as np

from engines.tissue.organs.shape import Shape, mesher, smooth_union
from schemas.vectors import Vector

__all__ = ["KIDNEY_WITH_ADRENAL"]

_HALF_KIDNEY_M = np.array([0.055, 0.030, 0.020])
"""Half of length, breadth and thickness: about 11 cm, 5 to 7.5 cm, more than 2.5 cm (Gray 1918); 4 cm give a
mass inside Gray's 125 to 170 g.
"""

_HALF_GLAND_M = np.array([0.019, 0.018, 0.005])
"""Half of height, breadth and thickness: 35 to 73 mm, 15 to 40 mm and 3 to 18 mm are found (Bergman et al.),
30 to 50 mm are usual (Gray 1918).
"""

_OVERLAP_M = 0.010
"""Overlap of the gland with the pole, m: the gland sits on the pole like a cap."""

_THICK_KIDNEY_M, _THICK_GLAND_M = 0.026, 0.016
"""Half thicknesses of the meshed body."""

_TAPER = 0.5
"""Taper of the gland, a pyramid with round edges: relative difference of the breadths at base and apex from
the mean. By eye.
"""

_BLEND_M = 0.003
"""Depth of the transition between kidney and gland. By eye."""

_HILUM_M, _HILUM_RADIUS_M = 0.009, 0.016
"""Depth and radius of the notch at the hilum. By eye."""

_BEND_M, _BEND_RADIUS_M = 0.017, 0.050
"""Bend of the poles around the hilum, and length of the bend. By eye."""


def _field(points: Vector) -> Vector:
    """Positive inside a straight kidney with a gland as thick as itself."""
    hilum = np.array([0.0, _HALF_KIDNEY_M[1], 0.0])
    notch = _HILUM_M * np.exp(-((points - hilum) ** 2).sum(axis=1) / _HILUM_RADIUS_M**2)
    kidney = (
        _THICK_KIDNEY_M * (1.0 - np.linalg.norm(points / [*_HALF_KIDNEY_M[:2], _THICK_KIDNEY_M], axis=1))
        - notch
    )
    gland = (points - [_HALF_KIDNEY_M[0] - _OVERLAP_M + _HALF_GLAND_M[0], 0.0, 0.0]) / [
        *_HALF_GLAND_M[:2],
        _THICK_GLAND_M,
    ]
    gland[:, 1] /= 1.0 - _TAPER * np.clip(gland[:, 0], -1.0, 1.0)
    return smooth_union(kidney, _THICK_GLAND_M * (1.0 - np.linalg.norm(gland, axis=1)), _BLEND_M)


def _formed(points: Vector) -> Vector:
    """Thin the gland and bend the kidney."""
    x, y, z = points.T
    share = np.clip((x - 0.040) / 0.025, 0.0, 1.0)
    kidney, gland = _HALF_KIDNEY_M[2] / _THICK_KIDNEY_M, _HALF_GLAND_M[2] / _THICK_GLAND_M
    thinned = kidney + (gland - kidney) * share**2 * (3.0 - 2.0 * share)
    bent = _BEND_M * (1.0 - np.exp(-((x / _BEND_RADIUS_M) ** 2)))
    return np.stack([x, y + bent - 0.25 * _BEND_M, z * thinned], axis=1)


KIDNEY_WITH_ADRENAL = Shape(
    description=(
        "a left kidney, 110 x 60 x 40 mm (Gray, Anatomy of the Human Body, 20th edition, 1918), with its"
        " adrenal gland, 38 x 36 x 10 mm (Bergman et al., Encyclopedia of Human Anatomic Variation IV), on"
        " the upper pole; it lies on its back around the origin: +x is cranial, +y medial, +z anterior"
    ),
    mesh=mesher(_field, _formed, low=(-0.055, -0.030, -0.026), high=(0.085, 0.030, 0.026)),
    surfaces={
        "posterior": (
            lambda nodes: (nodes[:, 2] < -0.5 * _HALF_KIDNEY_M[2]) & (nodes[:, 0] < _HALF_KIDNEY_M[0])
        ),
        "gland": lambda nodes: nodes[:, 0] > _HALF_KIDNEY_M[0] + _BLEND_M,
    },
    anchors=("posterior",),
    material="kidney",
)
