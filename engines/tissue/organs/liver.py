"""The left lobe of a liver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.tissue.organs.shape import Shape, mesher
from schemas.vectors import Vector

__all__ = ["LIVER_LOBE"]

_HALF_M = np.array([0.050, 0.060, 0.021])
"""Half of length from the diaphragm to the free edge, of breadth and of the thickness at the diaphragm.

By eye, to the volume of 0.2 kg: Gray (1918) has livers of 1.4 to 1.6 kg with right lobes six times as large
as the left.
"""

_THICK_M = 0.030
"""Half thickness of the meshed body."""

_EDGE_M = 0.014
"""Thickness where the free edge begins to be round."""

_NARROWING = 0.2
"""Relative difference of the lobe's breadth at the diaphragm and at the edge from the middle. By eye."""

_DOME_M = 0.014
"""How far the edge and the sides lie below the top of the dome. By eye."""

_BLUNTNESS = 2.5
"""Exponent of the outline, a superellipse. By eye."""


def _field(points: Vector) -> Vector:
    """Positive inside a flat lobe of uniform thickness, as at the diaphragm."""
    x, y, z = (points / [*_HALF_M[:2], _THICK_M]).T
    outline = np.abs(x) ** _BLUNTNESS + np.abs(y / (1.0 - _NARROWING * np.clip(x, -1.5, 1.5))) ** _BLUNTNESS
    return _THICK_M * (1.0 - np.sqrt(outline ** (3.0 / _BLUNTNESS) + z**2))


def _formed(points: Vector) -> Vector:
    """Thin the lobe towards the edge, and add the dome."""
    x, y, z = points.T
    thinned = (_HALF_M[2] + (0.5 * _EDGE_M - _HALF_M[2]) * _along(x)) / _THICK_M
    return np.stack([x, y, z * thinned + _middle(x, y)], axis=1)


def _along(x: Vector) -> Vector:
    """Return the way from the diaphragm (0) to the edge (1)."""
    return 0.5 * (1.0 + x / _HALF_M[0])


def _middle(x: Vector, y: Vector) -> Vector:
    """Return the height (m) half-way between the upper and the lower surface."""
    return -_DOME_M * (_along(x) ** 2 + (y / _HALF_M[1]) ** 2)


def _on_diaphragm(nodes: Vector) -> NDArray[np.bool_]:
    """The upper surface of the half under the diaphragm, held there by ligaments."""
    x, y, z = nodes.T
    return (x < 0.0) & (z > _middle(x, y))


LIVER_LOBE = Shape(
    description=(
        "the left lobe of a liver, 100 mm from the diaphragm to its free edge, 125 mm broad, 42 mm thick and"
        " 14 mm at the edge, 0.2 kg: a seventh of a liver (Gray, Anatomy of the Human Body, 20th edition,"
        " 1918). It hangs under the diaphragm, its middle at the origin: +x is towards the edge, +z anterior"
    ),
    mesh=mesher(_field, _formed, low=(-0.050, -0.066, -0.030), high=(0.050, 0.066, 0.030)),
    surfaces={
        "diaphragm": _on_diaphragm,
        "edge": lambda nodes: nodes[:, 0] > 0.7 * _HALF_M[0],
    },
    anchors=("diaphragm",),
    material="liver",
)
