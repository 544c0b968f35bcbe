"""Organs between the jaws of an instrument: on what a clip closes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engines.fem.organ import Organ
from engines.fem.spheres import near_faces
from engines.tissue.probes.clip import ClipParams
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["organs_between"]

_POINTS = 13, 7
"""Points along the legs of the clip and from leg to leg, around which faces are sought."""


def organs_between(organs: Sequence[Organ], jaws: Vector, along: Vector, clip: ClipParams) -> set[str]:
    """Return the names of the organs with a face in the box between the legs of a clip.

    jaws: centres of the spheres of both jaws, m, in `world`, shape (2, n, 3). along: direction of the tube
    nearest to the clip, for jaws of one sphere.
    """
    ends = jaws.mean(axis=1)
    spread = float(np.linalg.norm(ends[1] - ends[0]))
    if spread == 0.0:
        return set()
    closing = (ends[1] - ends[0]) / spread
    legs = jaws[:, -1].mean(axis=0) - jaws[:, 0].mean(axis=0)
    legs = cross(closing, along) if jaws.shape[1] == 1 else legs - float((legs * closing).sum()) * closing
    size = float(np.linalg.norm(legs))
    if size == 0.0:
        return set()
    axes = np.stack([legs / size, closing, cross(legs / size, closing)])
    half = 0.5 * np.array([clip.length, spread, clip.width])
    u, v = (np.linspace(-1.0, 1.0, count) for count in _POINTS)
    local = np.stack([*np.meshgrid(u, v, indexing="ij"), np.zeros(_POINTS)], axis=-1).reshape(-1, 3) * half
    reach = float(np.linalg.norm(half / np.array([*_POINTS, 1.0])))
    centres: Vector = np.ascontiguousarray(ends.mean(axis=0) + local @ axes)
    return {organ.name for organ in organs if _has_face(organ, centres, reach, ends.mean(axis=0), axes, half)}


def _has_face(
    organ: Organ, centres: Vector, reach: float, middle: Vector, axes: Vector, half: Vector
) -> bool:
    """Return whether the nearest points of faces near these centres lie in a box."""
    near = near_faces(centres, np.full(len(centres), reach), organ.nodes, organ.touchable)
    points: Vector = (near.weights[:, :, None] * organ.nodes[near.faces]).sum(axis=1)
    return bool((np.abs((points - middle) @ axes.T) <= half).all(axis=1).any())
