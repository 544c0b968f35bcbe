"""A block that is cut open down its middle: made by hand, no engine has stepped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.tissue_surface import TissueSurface
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


class EditedSurface(TissueSurface):
    """A surface that is changed by hand."""

    def add_nodes(self, origins: NDArray[np.integer]) -> NDArray[np.int32]:
        """Append a copy of each of these nodes; return the numbers of the copies."""
        first = self.node_count
        appended = origins >= self._first_nodes
        roots = origins.astype(np.int32)
        roots[appended] = self.origins[roots[appended] - self._first_nodes]
        self.origins = np.concatenate([self.origins, roots])
        self.version += 1
        return np.arange(first, self.node_count, dtype=np.int32)

    def append(self, faces: NDArray[np.integer], kinds: NDArray[np.integer]) -> NDArray[np.int64]:
        """Append faces, shape (k, 3), with their kinds, shape (k,); return their slots."""
        first = len(self.faces)
        self.faces = np.concatenate([self.faces, faces.astype(np.int32)])
        self.kinds = np.concatenate([self.kinds, kinds.astype(np.uint8)])
        self.version += 1
        return np.arange(first, len(self.faces))

    def remove(self, slots: NDArray[np.integer]) -> None:
        """Empty these slots: the tissue is gone."""
        self.faces[slots] = -1
        self.version += 1


class CutBlock:
    """The block, its surface, and its nodes.

    `cut` separates the elements left (-x) and right of the middle, above a depth; `part` moves the halves.
    """

    def __init__(self, size: Vector, nodes: int) -> None:
        self.mesh: TetMesh = block(size, nodes)
        self.surface = EditedSurface(self.mesh.triangles, len(self.mesh.nodes))
        self._sides: NDArray[np.int64] = np.zeros(len(self.mesh.nodes), np.int64)

    def cut(self, depth: float, kind: FaceKind = FaceKind.CUT) -> None:
        """Open the faces between the halves down to `depth` (m) below the top."""
        mesh, surface = self.mesh, self.surface
        tets = mesh.tetrahedra
        right = mesh.nodes[tets].mean(axis=1)[:, 0] > 0.0
        faces = tets[:, _FACES].reshape(-1, 3)
        of_right = np.repeat(right, 4)
        numbers = mesh.face_numbers.ravel()
        order = np.argsort(numbers, kind="stable")
        pairs = np.flatnonzero(numbers[order][1:] == numbers[order][:-1])
        one, other = order[pairs], order[pairs + 1]
        deep = mesh.nodes[faces[one]].mean(axis=1)[:, 2] > mesh.nodes[:, 2].max() - depth
        between = (of_right[one] != of_right[other]) & deep
        one, other = one[between], other[between]
        left_face = np.where(of_right[one], other, one)
        right_face = np.where(of_right[one], one, other)
        # nodes at the lower end of the cut stay whole
        inner = faces[left_face]
        low = mesh.nodes[inner][..., 2].min()
        opened = np.unique(inner)
        if depth < np.ptp(mesh.nodes[:, 2]):
            opened = opened[mesh.nodes[opened, 2] > low + 1e-9]
        twin = np.arange(surface.node_count)
        twin[opened] = surface.add_nodes(opened)
        self._sides = np.concatenate([self._sides, np.ones(len(opened), np.int64)])
        outside = faces[np.isin(numbers, numbers[np.bincount(numbers)[numbers] == 1])]
        is_right = dict(
            zip(
                map(tuple, np.sort(outside, axis=1).tolist()),
                of_right[np.bincount(numbers)[numbers] == 1].tolist(),
                strict=True,
            )
        )
        slots = np.array(
            [
                i
                for i, face in enumerate(self.mesh.triangles.tolist())
                if is_right[tuple(sorted(face))] and np.isin(face, opened).any()
            ]
        )
        if len(slots):
            surface.replace(slots, twin[self.mesh.triangles[slots]], surface.kinds[slots])
        surface.append(inner, np.full(len(inner), kind))
        surface.append(twin[faces[right_face]], np.full(len(inner), kind))

    def part(self, gap: float) -> Vector:
        """Return the nodes with the lips of the cut `gap` metres apart at the top, shape (n, 3)."""
        nodes = np.concatenate([self.mesh.nodes, self.mesh.nodes[self.surface.origins]])
        height = (nodes[:, 2] - nodes[:, 2].min()) / np.ptp(nodes[:, 2])
        on_right = self._sides == 1
        on_right[: len(self.mesh.nodes)] = self.mesh.nodes[:, 0] > 1e-9
        shift = np.where(on_right, 0.5, -0.5) * gap * height
        nodes[:, 0] += shift
        return nodes
