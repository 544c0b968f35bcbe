"""Faces of the elements of a body: the face on the other side of each, and the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from engines.fem.arrays import aligned_integers
from engines.tissue.meshing.tet_mesh import Indices, TetMesh

__all__ = ["FACE_CORNERS", "Faces"]

FACE_CORNERS = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corners of the face opposite to each corner, seen from outside against the clock, as in `_topology.c`."""


class Faces:
    """Face 4 e + k is the one of element e opposite to its corner k."""

    def __init__(self, mesh: TetMesh, tetrahedra: Indices, room: int) -> None:
        """`tetrahedra`: elements in the body's order, shape (m, 4); `room`: their number with fillers."""
        faces = tetrahedra[:, FACE_CORNERS].reshape(-1, 3)
        keys = np.sort(np.concatenate([faces, mesh.triangles]), axis=1)
        _, number = np.unique(keys, axis=0, return_inverse=True)
        inner, outer = number.ravel()[: len(faces)], number.ravel()[len(faces) :]
        order = np.argsort(inner, kind="stable")
        pairs = np.flatnonzero(inner[order][1:] == inner[order][:-1])
        one, other = order[pairs], order[pairs + 1]
        self.across: NDArray[np.int32] = aligned_integers(np.full((room, 4), -1))
        """The face on the other side, or ~slot for a face of the surface, shape (room, 4)."""
        across = self.across.reshape(-1)
        across[one], across[other] = other, one
        face_of = np.full(int(number.max()) + 1, -1)
        face_of[inner] = np.arange(len(faces))
        owners = face_of[outer]
        across[owners] = ~np.arange(len(owners))
        self.surface: NDArray[np.int32] = aligned_integers(np.full((4 * room, 3), -1))
        """Nodes by slot, the mesh's triangles first; -1: no face, shape (4 room, 3)."""
        self.surface[: len(owners)] = mesh.triangles
        self.owner: NDArray[np.int32] = aligned_integers(np.full(4 * room, -1))
        """Face of an element by slot, shape (4 room,)."""
        self.owner[: len(owners)] = owners
