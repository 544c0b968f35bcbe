"""Compliance of the surface of an anchored mesh under a force: of the mesh, and of the body itself.

A coarse mesh is too stiff under a small sphere, and right in the bending of the whole body. So the body is a
half-space at the place of the force plus the effect of all other boundaries, smooth enough for the coarse
mesh: Boussinesq's field is cancelled at the free faces and at the anchored nodes (the method of
superposition, as for image forces).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from engines.tissue.elasticity.body_yield import BodyYield
from engines.tissue.elasticity.dense_body_yield import DenseBodyYield
from engines.tissue.elasticity.rims import MIRRORED, mirror_displacement, rims_of
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from schemas.vectors import Vector

__all__ = ["SurfaceCompliance"]

_DIGITS = 6
"""Significant digits kept: the rounding of a sum in another order must not matter."""

_SAME_SIDE = 0.9
"""Least cosine between the normals of two faces on the same side of a rim."""


class SurfaceCompliance:
    """Linear compliance of the surface of an anchored mesh about the resting shape."""

    def __init__(
        self,
        mesh: TetMesh,
        anchored: NDArray[np.bool_],
        faces: Indices,
        material: Material,
        *,
        body_yield: type[DenseBodyYield | BodyYield] = DenseBodyYield,
    ) -> None:
        """`anchored`: shape (n,), some true; `faces`: free faces, (f, 3); `body_yield`: its solver."""
        self._surface = surface = np.unique(faces)
        self._place = np.zeros(len(mesh.nodes), dtype=np.int64)
        self._place[surface] = np.arange(len(surface))
        solver = body_yield(mesh, anchored, faces, material)
        self._between = _rounded(solver.between(surface))
        self._normals = normals = _normals(mesh, faces, surface)
        body = solver.of_boundaries
        self._body = _rounded(
            np.array([body(*pair) for pair in zip(surface.tolist(), -normals, strict=True)])
        )
        self.rims = rims_of(mesh.nodes, faces)
        self._on_rim = self._sides(body)
        self._by_rim = self._without_mirror(mesh.nodes, material)

    def _sides(self, body: Callable[[int, Vector], float]) -> dict[int, list[tuple[Vector, float]]]:
        """Return, for every node of a rim, the normals of the sides and `of_body_at_rim`.

        A force on a rim and its mirror image are at the same place and are cancelled together.
        """
        found: dict[int, list[tuple[Vector, float]]] = {}
        for ends, sides in zip(self.rims.ends.tolist(), self.rims.outward, strict=True):
            for node in ends:
                known = found.setdefault(node, [])
                for normal in sides:
                    if all(float(normal @ other) < _SAME_SIDE for other, _ in known):
                        value = (1.0 + MIRRORED) * body(node, -normal)
                        known.append((normal, float(f"{value:.{_DIGITS}g}")))
        return found

    def _without_mirror(self, nodes: Vector, material: Material) -> Vector:
        """Return `_body` without the effect of the nearest rim, which the mesh has at nodes off the rim."""
        if not len(self.rims.ends):
            return self._body
        ways = np.array([self.rims.vectors(nodes[node], nodes) for node in self._surface])
        away = np.sqrt((ways * ways).sum(axis=2)).min(axis=1)
        known = (away > 0.0) & (self._body != 0.0)
        mirrored = np.zeros(len(away))
        mirrored[known] = mirror_displacement(away[known], material)
        return _rounded(self._body - mirrored)

    def of_mesh(self, nodes: Indices, inward: Vector) -> Vector:
        """Return the displacement (m) of surface `nodes`, (k,), under 1 N on each of them, shape (k, k).

        Force and motion are along `inward`, shape (3,).
        """
        at = self._place[nodes]
        between = self._between[at[:, None], at].reshape(-1, 9) @ (inward[:, None] * inward).ravel()
        return between.reshape(len(at), len(at))

    def on_surface(self, nodes: Indices) -> Indices:
        """Return the `nodes` on the surface."""
        return np.intersect1d(nodes, self._surface)

    def normals_at(self, nodes: Indices) -> Vector:
        """Return the outward normals at the surface's `nodes`, shape (k, 3)."""
        return self._normals[self._place[nodes]]

    def between(self, nodes: Indices) -> Vector:
        """Return the displacement (m) of surface `nodes` under 1 N on each, by node and axis, (3 k, 3 k)."""
        at = self._place[nodes]
        return self._between[np.ix_(at, at)].transpose(0, 2, 1, 3).reshape(3 * len(at), -1)

    def of_body(self, nodes: Indices, parts: Vector) -> float:
        """Return how much farther than a half-space the body gives way under a force of 1 N, in m.

        The force is perpendicular to the surface, near `nodes`, shape (k,), as the `parts` say. Below 0 where
        the body is anchored close behind.
        """
        return float(parts @ self._body[self._place[nodes]])

    def of_body_at_rim(self, nodes: Indices, parts: Vector, outward: Vector) -> float:
        """Return the body's compliance near a rim in excess of a quarter-space, in m.

        Arguments as for `of_body`; outward: normal of the pressed face, shape (3,).
        """
        values = self._by_rim[self._place[nodes]]
        for i, node in enumerate(nodes.tolist()):
            if sides := self._on_rim.get(node):
                values[i] = max(sides, key=lambda side: float(side[0] @ outward))[1]
        return float(parts @ values)


def _rounded(values: Vector) -> Vector:
    """Round values to `_DIGITS` of the largest value, in place, and return them."""
    largest = max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))
    if largest:
        values /= largest
        np.round(values, _DIGITS, out=values)
        values *= largest
    return values


def _normals(mesh: TetMesh, faces: Indices, surface: Indices) -> Vector:
    """Return the outward normals at the nodes `surface`, by the areas of their faces, shape (k, 3)."""
    corners = mesh.nodes[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.stack(
        [np.bincount(faces.ravel(), np.repeat(areas[:, i], 3), len(mesh.nodes)) for i in range(3)], axis=1
    )[surface]
    return sums / np.linalg.norm(sums, axis=1)[:, None]
