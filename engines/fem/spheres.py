"""The spheres of all probes of an engine: their ways in a step, and the forces of tissue on them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.probes.near_faces import NearFaces
from schemas.vectors import Vector

__all__ = ["MOST_CONTACTS", "Spheres", "near_faces"]

MOST_CONTACTS = 512
"""Most contacts of a sphere, as in `_solid.h`."""

_PAIRS = 1024
"""Pairs of a sphere and a near face for which there is room at first."""


class Spheres:
    """Arrays that every step writes anew."""

    def __init__(self, radii: Vector, sub_steps: int, probes: Sequence[str] = ()) -> None:
        """`radii`: of all spheres, m, shape (n,); `sub_steps`: their number k in a step."""
        self.radii = radii
        self.probes = probes
        """Name of the probe of every sphere."""
        self.path: Vector = np.zeros((sub_steps + 1, len(radii), 3))
        """Centres at the ends of the sub-steps, m, in `world`, shape (k + 1, n, 3)."""
        self.forces: Vector = np.zeros((sub_steps, len(radii), 3))
        """Force of the tissue in each sub-step, N, shape (k, n, 3)."""

    def sum_forces(self, parts: Iterable[Vector]) -> None:
        """Set `forces` to the sum of the forces of all organs."""
        first, *others = parts
        self.forces[:] = first
        for other in others:
            self.forces += other

    def nearest(self, places: Vector, among: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the sphere `among` these nearest to each place (m, shape (n, 3)); -1 if there is none."""
        if not len(among):
            return np.full(len(places), -1)
        away = np.linalg.norm(places[:, None] - self.path[-1][among], axis=2)
        return among[away.argmin(axis=1)].astype(np.int64)


def near_faces(
    centres: Vector, reach: Vector, nodes: Vector, faces: Indices, room: int = _PAIRS
) -> NearFaces:
    """Return all pairs of spheres and faces nearer than the sphere's reach: `near_faces` of tissue in C.

    Arguments as there; `room`: number of pairs for which there is room at first.
    """
    from engines.fem._probe import near_faces as find

    spheres, near = np.zeros(room, np.int64), np.zeros((room, 3), np.int64)
    weights, distances = np.zeros((room, 3)), np.zeros(room)
    found = find(centres, reach, nodes, faces, spheres, near, weights, distances)
    if found > room:
        return near_faces(centres, reach, nodes, faces, found)
    return NearFaces(spheres[:found], near[:found], weights[:found], distances[:found])
