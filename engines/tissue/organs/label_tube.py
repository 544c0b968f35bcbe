"""A duct or a vessel of a label map as a tube: centre line and diameters of its voxels."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.organs.label_body import LabelBody
from schemas.vectors import Vector

__all__ = ["LabelTube", "trace_tube"]

_SLABS_PER_DIAMETER, _FEWEST, _MOST = 1.0, 4, 40
"""Points of the centre line."""
_LEAST_ASPECT = 1.8
"""Length over diameter."""
_FARTHEST = 2.0
"""Distance of voxels from the centre line over the mean radius: more is a branch or no tube."""
_CENTRED = 2.0
"""Power of the depth by which ways near the wall are longer."""


@dataclass(frozen=True)
class LabelTube:
    """A tube without branches."""

    body: LabelBody
    path: Vector
    """Points of the centre line, m, shape (p, 3)."""
    diameters: Vector
    """Diameter of a circle of the label's cross-section at each point, m, shape (p,)."""

    @property
    def offset(self) -> float:
        """Distance of the surface outside the body, m."""
        return 0.0


def trace_tube(body: LabelBody) -> LabelTube:
    """Return the tube of a body.

    The way between the two voxels farthest apart within the body keeps to the middle; voxels are shared out
    to slabs along it, whose middles and cross-sections are the tube's. Raises ValueError for a body that is
    no tube.
    """
    places = np.argwhere(body.inside)
    points: Vector = places @ body.affine[:, :3].T + body.affine[:, 3]
    line = points[_way(body, places, points)]
    steps: Vector = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along: Vector = np.concatenate([[0.0], np.cumsum(steps)])
    length = float(along[-1])
    tree: Any = import_module("scipy.spatial").cKDTree
    distances, nearest = tree(line).query(points)
    diameter = float(2.0 * np.sqrt(body.field.raw_volume / np.pi / length))
    if length < _LEAST_ASPECT * diameter or distances.max() > _FARTHEST * 0.5 * diameter + body.field.spacing:
        raise ValueError(
            f"{body.name} is no tube without branches: {1e3 * length:.3g} mm long, {1e3 * diameter:.3g} mm"
            f" wide, and voxels up to {1e3 * distances.max():.3g} mm off its middle line. Mesh it as a solid,"
            " or cut off what branches"
        )
    count = int(np.clip(round(_SLABS_PER_DIAMETER * length / diameter), _FEWEST, _MOST))
    slab = np.minimum((along[nearest] / length * count).astype(np.int64), count - 1)
    voxels = np.maximum(np.bincount(slab, minlength=count), 1)
    middles = np.stack([np.bincount(slab, points[:, i], count) / voxels for i in range(3)], axis=1)
    areas: Vector = voxels * float(abs(np.linalg.det(body.affine[:, :3]))) * count / length
    widths: Vector = 2.0 * np.sqrt(areas / np.pi)
    first, last = 1.5 * middles[0] - 0.5 * middles[1], 1.5 * middles[-1] - 0.5 * middles[-2]
    ends = widths[1], widths[-2]  # slabs at the ends are round
    return LabelTube(
        body,
        np.concatenate([first[None], middles, last[None]]),
        np.concatenate([[ends[0], ends[0]], widths[1:-1], [ends[1], ends[1]]]),
    )


def _way(body: LabelBody, places: Indices, points: Vector) -> Indices:
    """Return the voxels of the way from end to end, in order."""
    sparse: Any = import_module("scipy.sparse")
    dijkstra: Any = import_module("scipy.sparse.csgraph").dijkstra
    numbers = np.full(body.inside.shape, -1)
    numbers[tuple(places.T)] = np.arange(len(places))
    padded = np.pad(numbers, 1, constant_values=-1)
    spacing = np.linalg.norm(body.affine[:, :3], axis=0)
    depths = import_module("scipy.ndimage").distance_transform_edt(np.pad(body.inside, 1), sampling=spacing)
    depth: Vector = depths[1:-1, 1:-1, 1:-1][tuple(places.T)]
    pairs: list[Indices] = []
    for step in product((-1, 0, 1), repeat=3):
        if step > (0, 0, 0):
            other = padded[tuple((places + 1 + step).T)]
            pairs.append(np.stack([np.flatnonzero(other >= 0), other[other >= 0]], axis=1))
    ends = np.concatenate(pairs)
    lengths: Vector = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    shape = len(places), len(places)

    def graph(weights: Vector) -> Any:
        return sparse.csr_matrix((weights, ends.T), shape=shape)

    plain = graph(lengths)
    first = int(dijkstra(plain, directed=False, indices=0).argmax())
    last = int(dijkstra(plain, directed=False, indices=first).argmax())
    shallow: Vector = (depth.max() / depth[ends].mean(axis=1)) ** _CENTRED
    _, before = dijkstra(graph(lengths * shallow), directed=False, indices=first, return_predecessors=True)
    way = [last]
    while way[-1] != first:
        way.append(int(before[way[-1]]))
    return np.array(way[::-1])
