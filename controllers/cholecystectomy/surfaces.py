"""Faces of the organs that the routine sees, kept from the first state of each."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from controllers.cholecystectomy.obstacles import Obstacles
from hub.participant import state_hash
from schemas.errors import StateError
from schemas.soft_surface import SoftSurface
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import Vector

__all__ = ["Surfaces"]


class Surfaces:
    """Triangles of organs by name; an organ without any is known by its nodes."""

    def __init__(self, organs: Iterable[str]) -> None:
        self._faces: dict[str, NDArray[np.int32]] = {organ: np.zeros((0, 3), np.int32) for organ in organs}
        self._digest = state_hash(self.save())

    def see(self, organ: str, message: SoftBodyState) -> None:
        """Keep the triangles of a first state. Raises MessageError if it is not valid."""
        if message.triangles.size:
            self._faces[organ] = SoftSurface.of_first(message).faces
            self._digest = state_hash(self.save())

    def obstacles(self, organ: str, nodes: Vector) -> Obstacles:
        """Return the surface of an organ with these nodes, m, shape (n, 3)."""
        faces = self._faces[organ]
        if faces.max(initial=-1) >= len(nodes) or not len(faces):
            return Obstacles.points(nodes, np.zeros(len(nodes)))
        return Obstacles(nodes[faces], np.zeros(len(faces)))

    @property
    def digest(self) -> bytes:
        """Hash of all triangles, 8 bytes."""
        return self._digest.to_bytes(8, "little")

    def save(self) -> bytes:
        """Return the bytes of all triangles."""
        parts = (np.int32(len(faces)).tobytes() + faces.tobytes() for faces in self._faces.values())
        return b"".join(parts)

    def restore(self, state: bytes) -> None:
        """Return to saved triangles. Raises StateError if their number is wrong."""
        found, at = list[NDArray[np.int32]](), 0
        for _ in self._faces:
            count = int(np.frombuffer(state, np.int32, 1, at)[0]) if len(state) >= at + 4 else -1
            size = 12 * count
            if count < 0 or len(state) < at + 4 + size:
                raise StateError("a saved state of clip-and-cut ends within the triangles of an organ")
            found.append(np.frombuffer(state, np.int32, 3 * count, at + 4).reshape(-1, 3))
            at += 4 + size
        if at != len(state):
            raise StateError(f"a saved state of clip-and-cut has {len(state) - at} bytes too many")
        self._faces.update(zip(self._faces, found, strict=True))
        self._digest = state_hash(self.save())
