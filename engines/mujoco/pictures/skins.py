"""Soft bodies of another engine in a MuJoCo scene: the state from their messages, and their skins.

MuJoCo draws a skin from `skin_vert` of its model, moved by bodies; bound to the world alone it is where the
vertices are. They and the normals are read again for every picture, without an upload beforehand
(docs/decisions/0017).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.skin_params import SkinParams
from schemas.errors import SessionError, StateError
from schemas.message import Message
from schemas.trocar_msgs import SoftBodyState

if TYPE_CHECKING:
    import mujoco

__all__ = ["Skins", "SoftBody"]

_SHAPE = struct.Struct("<qq")
"""Number of nodes and of triangles."""
_SPECULAR, _SHININESS = 0.5, 0.7
"""Shine of wet tissue: small highlights. Chosen by eye."""


class SoftBody:
    """A soft body as the messages on one port describe it.

    The surface and the shape at rest come with the first message, the nodes with the newest.
    """

    def __init__(self, port: str) -> None:
        self._port = port
        self.rest: NDArray[np.float32] = np.zeros((0, 3), np.float32)
        """Shape (n, 3), m, frame `world`."""
        self.nodes = self.rest
        """Shape (n, 3), m, frame `world`."""
        self.triangles: NDArray[np.uint32] = np.zeros((0, 3), np.uint32)
        """Node indices, shape (f, 3), counter-clockwise from outside."""

    def accept(self, message: Message | None) -> None:
        """Take the newest message.

        Raises SessionError if the surface is unknown, or the message does not fit it.
        """
        if not isinstance(message, SoftBodyState) or message.nodes_m.size % 3:
            raise SessionError(
                f"input '{self._port}': expected the nodes of a soft body, three numbers each, got"
                f" {message!r}"
            )
        nodes = message.nodes_m.reshape(-1, 3)
        if not len(self.triangles):
            self._begin(nodes, message.triangles)
        if nodes.shape != self.nodes.shape:
            raise SessionError(
                f"input '{self._port}': {len(nodes)} nodes, but {len(self.nodes)} before; a soft body keeps"
                " its mesh for a session"
            )
        self.nodes = nodes

    def _begin(self, nodes: NDArray[np.float32], triangles: NDArray[np.uint32]) -> None:
        if not triangles.size:
            raise SessionError(
                f"input '{self._port}': the first message has no triangles, which come with the state at time"
                " 0. An `order` that puts the tissue before this participant makes it miss that state: remove"
                " this participant from the order"
            )
        if triangles.size % 3 or triangles.max() >= len(nodes):
            raise SessionError(
                f"input '{self._port}': the triangles are not three node indices each, below {len(nodes)}"
            )
        self.rest = self.nodes = nodes
        self.triangles = triangles.reshape(-1, 3)

    def save(self) -> bytes:
        """Return all soft bodies known from the messages."""
        return (
            _SHAPE.pack(len(self.rest), len(self.triangles))
            + self.rest.tobytes()
            + self.nodes.tobytes()
            + self.triangles.tobytes()
        )

    def restore(self, state: bytes) -> bytes:
        """Restore what `save` returned from the beginning of `state`; return what follows it.

        Raises StateError if it is incomplete.
        """
        try:
            count, triangles = _SHAPE.unpack_from(state)
            rest, nodes = np.frombuffer(state, np.float32, 6 * count, _SHAPE.size).reshape(2, count, 3)
            at = _SHAPE.size + rest.nbytes + nodes.nbytes
            self.triangles = np.frombuffer(state, np.uint32, 3 * triangles, at).reshape(triangles, 3)
        except (struct.error, ValueError) as error:
            raise StateError(
                f"a saved state of {len(state)} bytes contains no soft body for '{self._port}': {error}; was"
                " it saved by another scene?"
            ) from error
        self.rest, self.nodes = rest, nodes
        return state[at + self.triangles.nbytes :]


class Skins:
    """The skins of soft bodies in one model."""

    def __init__(
        self, scene: mujoco.MjSpec, bodies: Mapping[str, SoftBody], params: Mapping[str, SkinParams]
    ) -> None:
        """Add a skin per soft body, by name, to `scene`."""
        self._bodies = bodies
        self._meshes = {
            name: SkinMesh(body.rest.astype(np.float64), body.triangles.astype(np.int64))
            for name, body in bodies.items()
        }
        for name, mesh in self._meshes.items():
            vertices = mesh.vertices(bodies[name].rest.astype(np.float64))
            material = scene.add_material(
                name=f"{name}/skin",
                rgba=[*params[name].rgb(name), 1.0],
                specular=_SPECULAR,
                shininess=_SHININESS,
            )
            scene.add_skin(
                name=name,
                material=material.name,
                vert=vertices.ravel(),
                face=mesh.faces.ravel(),
                bodyname=["world"],
                bindpos=[0.0, 0.0, 0.0],
                bindquat=[1.0, 0.0, 0.0, 0.0],
                vertid=[list(range(len(vertices)))],
                vertweight=[[1.0] * len(vertices)],
            )

    def show(self, model: mujoco.MjModel) -> None:
        """Move the skins in `model`, compiled from the scene, to where the nodes are now."""
        for name, mesh in self._meshes.items():
            skin = model.skin(name)
            start, count = int(skin.vertadr[0]), int(skin.vertnum[0])
            model.skin_vert[start : start + count] = mesh.vertices(
                self._bodies[name].nodes.astype(np.float64)
            )
