"""A length of colon."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.grid import tetrahedra_of_cells
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.shape import ROUNDING_DIGITS, Shape
from schemas.vectors import Vector

__all__ = ["COLON"]

_LENGTH_M = 0.120
_RADIUS_M = 0.0225
_WALL_M = 0.005

_HAUSTRA = 4
"""Number of haustra along the length, every 30 mm. By eye."""

_TAENIAE = 3
"""Bands along the colon, between bulging haustra; the first is on the mesenteric side."""

_BULGE = 0.14
"""Relative height of the haustra, and depth of the folds in between. By eye."""

_LAYOUTS = [
    (around, along, layers)
    for layers in (1, 2, 3)
    for around in range(12, 61, 6)
    for along in range(2 * _HAUSTRA, 25 * _HAUSTRA, _HAUSTRA)
]
"""Numbers of cells with nodes on the taeniae and the folds."""


def _mesh(nodes: int) -> TetMesh:
    return _tube_mesh(*min(_LAYOUTS, key=lambda cells: _grid_unfitness(cells, nodes)))


def _grid_unfitness(cells: tuple[int, int, int], nodes: int) -> float:
    """Return the relative error of the number of nodes, times ten, plus the elongation of the cells."""
    around, along, layers = cells
    miss = abs(around * (along + 1) * (layers + 1) / nodes - 1.0)
    edges = 2.0 * np.pi * _RADIUS_M / around, _LENGTH_M / along, _WALL_M / layers
    return 10.0 * miss + max(edges) / min(edges)


@lru_cache(maxsize=16)
def _tube_mesh(around: int, along: int, layers: int) -> TetMesh:
    i, j, k = (
        index.ravel()
        for index in np.meshgrid(
            np.arange(along + 1), np.arange(around), np.arange(layers + 1), indexing="ij"
        )
    )
    x, angle = _LENGTH_M * (i / along - 0.5), 2.0 * np.pi * j / around
    between_folds = np.abs(np.sin(np.pi * _HAUSTRA * i / along))
    between_taeniae = np.abs(np.sin(0.5 * _TAENIAE * angle))
    outer = _RADIUS_M * (1.0 + _BULGE * between_taeniae * (2.0 * between_folds - 1.0))
    radius = outer - _WALL_M * (1.0 - k / layers)
    points = np.stack([x, -radius * np.sin(angle), -radius * np.cos(angle)], axis=1)
    return TetMesh(
        np.round(points, ROUNDING_DIGITS), tetrahedra_of_cells((along, around, layers), closed=True)
    )


_MESENTERY_RAD = 0.3
"""Half angle of the mesentery's attachment: a taenia, 1 cm wide."""

_NANOMETRE = 1e-9


def _on_mesentery(nodes: Vector) -> NDArray[np.bool_]:
    angle, radius = np.arctan2(np.abs(nodes[:, 1]), -nodes[:, 2]), np.hypot(nodes[:, 1], nodes[:, 2])
    return (angle < _MESENTERY_RAD) & (radius > _RADIUS_M - 0.5 * _WALL_M)


COLON = Shape(
    description=(
        "a length of colon: a tube of 120 mm, about 45 mm wide, with four haustra between three taeniae and a"
        " wall of 5 mm, that of a collapsed segment (CT Colonography Atlas, Springer 2013, Normal Colon); it"
        " lies along x around the origin, its mesentery at -z"
    ),
    mesh=_mesh,
    surfaces={
        "oral-end": lambda nodes: nodes[:, 0] < -0.5 * _LENGTH_M + _NANOMETRE,
        "anal-end": lambda nodes: nodes[:, 0] > 0.5 * _LENGTH_M - _NANOMETRE,
        "mesentery": _on_mesentery,
    },
    anchors=("oral-end", "anal-end", "mesentery"),
    material="colon",
)
