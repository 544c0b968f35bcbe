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

from engines.tissue.elasticity.half_space import point_displacement, point_stress
from engines.tissue.elasticity.rims import MIRRORED, mirror_displacement, rims_of
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from schemas.vectors import Vector

__all__ = ["MOST_NODES", "SurfaceCompliance"]

MOST_NODES = 1200
"""Most nodes: the compliance is a dense matrix, of 100 MB and some seconds at this size."""

_DIGITS = 6
"""Significant digits kept: the rounding of a sum in another order must not matter."""

_SAME_SIDE = 0.9
"""Least cosine between the normals of two faces on the same side of a rim."""

_POINTS: Vector = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
"""Barycentric coordinates of the points, of equal weight, for the integral of a quadratic function over a
face (Strang and Fix, An Analysis of the Finite Element Method, 1973).
"""


class SurfaceCompliance:
    """Linear compliance of the surface of an anchored mesh about the resting shape."""

    def __init__(
        self, mesh: TetMesh, anchored: NDArray[np.bool_], faces: Indices, material: Material
    ) -> None:
        """`anchored`: shape (n,), some true; `faces`: free faces, (f, 3); at most `MOST_NODES` nodes."""
        stiffness = _stiffness(mesh, material)
        free, fixed = (np.flatnonzero(np.repeat(which, 3)) for which in (~anchored, anchored))
        inverse: Vector = np.zeros_like(stiffness)
        inverse[np.ix_(free, free)] = np.linalg.inv(stiffness[np.ix_(free, free)])
        self._surface = surface = np.unique(faces)
        self._place = np.zeros(len(mesh.nodes), dtype=np.int64)
        self._place[surface] = np.arange(len(surface))
        blocks = inverse.reshape(len(mesh.nodes), 3, len(mesh.nodes), 3)
        self._between = _rounded(blocks[surface][:, :, surface].transpose(0, 2, 1, 3))
        tied = stiffness[:, fixed]

        def body(node: int, inward: Vector) -> float:
            """Return the displacement by the other boundaries under 1 N along `inward` on a node, m."""
            if anchored[node]:
                return 0.0
            held = -point_displacement(mesh.nodes[anchored] - mesh.nodes[node], inward, material).ravel()
            load = _cancelling_forces(mesh.nodes, faces, node, inward, material).ravel() - tied @ held
            return float(inward @ blocks[node].reshape(3, -1) @ load)

        self._normals = normals = _normals(mesh, faces, surface)
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
        between = self._between[np.ix_(at, at)].reshape(-1, 9) @ np.outer(inward, inward).ravel()
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
    """Return values rounded to `_DIGITS` of the largest value."""
    largest = float(np.abs(values).max(initial=0.0))
    return values if largest == 0.0 else np.round(values / largest, _DIGITS) * largest


def _stiffness(mesh: TetMesh, material: Material) -> Vector:
    """Return the stiffness (N/m) of linear tetrahedra at rest, shape (3 n, 3 n)."""
    tetrahedra, size = mesh.tetrahedra, 3 * len(mesh.nodes)
    edges = mesh.nodes[tetrahedra[:, 1:]] - mesh.nodes[tetrahedra[:, :1]]
    inverse = np.linalg.inv(edges)
    gradients = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2).transpose(0, 2, 1)
    mu, lambda_ = material.lame
    dyads = np.einsum("mai,mbj->maibj", gradients, gradients)
    blocks = lambda_ * dyads + mu * dyads.transpose(0, 1, 4, 3, 2)
    blocks += mu * np.einsum("maibi,jk->majbk", dyads, np.eye(3))
    blocks *= (np.linalg.det(edges) / 6.0)[:, None, None, None, None]
    places = (3 * tetrahedra[:, :, None] + np.arange(3)).reshape(-1, 12)
    cells = (places[:, :, None] * size + places[:, None, :]).ravel()
    return np.bincount(cells, blocks.ravel(), size * size).astype(np.float64).reshape(size, size)


def _normals(mesh: TetMesh, faces: Indices, surface: Indices) -> Vector:
    """Return the outward normals at the nodes `surface`, by the areas of their faces, shape (k, 3)."""
    corners = mesh.nodes[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.stack(
        [np.bincount(faces.ravel(), np.repeat(areas[:, i], 3), len(mesh.nodes)) for i in range(3)], axis=1
    )[surface]
    return sums / np.linalg.norm(sums, axis=1)[:, None]


def _cancelling_forces(
    nodes: Vector, faces: Indices, node: int, inward: Vector, material: Material
) -> Vector:
    """Return the forces (N), shape (n, 3), against the stress on the faces of 1 N along `inward` on a node.

    Faces around the node itself are left out: they are the surface of the half-space.
    """
    others = faces[(faces != node).all(axis=1)]
    corners = nodes[others]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    points = np.einsum("qa,fai->fqi", _POINTS, corners)
    stress = point_stress((points - nodes[node]).reshape(-1, 3), inward, material).reshape(*points.shape, 3)
    forces = -np.einsum("fqij,fj,qa->fai", stress, areas, _POINTS) / len(_POINTS)
    total = np.zeros_like(nodes)
    np.add.at(total, others, forces)
    return total
