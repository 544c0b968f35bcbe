"""The surface of an organ that is cut, torn and burnt: its faces by slot, and what has changed of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices
from schemas.ros import Header, Time
from schemas.soft_surface import FaceKind
from schemas.trocar_msgs import SurfaceChange

__all__ = ["SurfaceState", "TissueSurface"]

_GONE = -1
"""Node number of a face without tissue."""


class SurfaceState(NamedTuple):
    """State of a surface as plain arrays."""

    version: NDArray[np.int64]
    """Version, version of the newest message, and time stamp of this message, ns, shape (3,)."""
    faces: NDArray[np.int32]
    """Shape (f, 3)."""
    kinds: NDArray[np.uint8]
    """Shape (f,)."""
    origins: NDArray[np.int32]
    """Shape (m,)."""


class TissueSurface:
    """Faces of an organ by slot. A face keeps its slot for the session; nodes are appended."""

    def __init__(self, triangles: Indices, nodes: int) -> None:
        """`triangles`: the surface at rest, shape (f, 3); `nodes`: number of nodes of the mesh."""
        self._first = triangles.astype(np.int32)
        self._first_nodes = nodes
        self.faces: NDArray[np.int32] = self._first.copy()
        """Nodes of the face in each slot, shape (f, 3), counter-clockwise seen from outside; -1: no face."""
        self.kinds: NDArray[np.uint8] = np.zeros(len(triangles), np.uint8)
        """Kind of tissue of each face, a `schemas.soft_surface.FaceKind`, shape (f,)."""
        self.origins: NDArray[np.int32] = np.zeros(0, np.int32)
        """Node of the mesh at the resting place of each appended node, shape (m,)."""
        self.version = 0
        """Count of the changes."""
        self._sent = self._sent_ns = 0
        """Version and time stamp of the newest message."""
        self._message: SurfaceChange | None = None

    @property
    def node_count(self) -> int:
        """Number of nodes, appended nodes included."""
        return self._first_nodes + len(self.origins)

    @property
    def present(self) -> NDArray[np.int32]:
        """The faces with tissue, shape (k, 3)."""
        return self.faces[self.faces[:, 0] != _GONE]

    def replace(
        self, slots: NDArray[np.integer], faces: NDArray[np.integer], kinds: NDArray[np.integer]
    ) -> None:
        """Change the faces in these slots, in place. `faces`: shape (k, 3); `kinds`: shape (k,)."""
        self.faces[slots] = faces
        self.kinds[slots] = kinds
        self.version += 1

    def follow(self, faces: NDArray[np.int32], origins: NDArray[np.int32]) -> None:
        """Take the faces of an engine that keeps them by slot; appended faces are the inside of a cut.

        faces: shape (f, 3), -1 where tissue is gone. origins: node of the mesh at the resting place of each
        node, shape (n,).
        """
        appended = len(faces) - len(self.faces)
        if not appended and len(origins) == self.node_count and np.array_equal(faces, self.faces):
            return
        self.faces = faces.copy()
        self.kinds = np.concatenate([self.kinds, np.full(appended, FaceKind.CUT, np.uint8)])
        self.origins = origins[self._first_nodes :].copy()
        self.version += 1

    def change(self, body: str, time_ns: int) -> SurfaceChange:
        """Return the message of organ `body` at `time_ns`; the same object as long as nothing changes."""
        if self._sent != self.version:
            self._sent, self._sent_ns, self._message = self.version, time_ns, None
        if self._message is None:
            self._message = self._difference(body)
        return self._message

    def _difference(self, body: str) -> SurfaceChange:
        count = len(self._first)
        differs = np.ones(len(self.faces), np.bool_)
        differs[:count] = (self.faces[:count] != self._first).any(axis=1) | (self.kinds[:count] != 0)
        slots = np.flatnonzero(differs)
        return SurfaceChange(
            header=Header(stamp=Time.from_ns(self._sent_ns), frame_id="world"),
            body=body,
            version=self.version,
            slots=slots.astype(np.uint32),
            faces=self.faces[slots].ravel(),
            kinds=self.kinds[slots],
            origins=self.origins.astype(np.uint32),
        )

    @property
    def state(self) -> SurfaceState:
        """The whole state."""
        version = np.array([self.version, self._sent, self._sent_ns])
        return SurfaceState(version, self.faces.copy(), self.kinds.copy(), self.origins.copy())

    def restore(self, state: SurfaceState) -> None:
        """Return to a saved state of the same organ."""
        self.version, self._sent, self._sent_ns = state.version.tolist()
        self.faces, self.kinds = state.faces.copy(), state.kinds.copy()
        self.origins, self._message = state.origins.copy(), None
