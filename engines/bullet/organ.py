"""An organ: an anchored body of soft tissue in a Bullet world."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from engines.bullet.world import COLLISION_MARGIN_M, quiet
from engines.tissue.organs.anchors import WORLD
from engines.tissue.organs.params import OrganParams
from schemas.errors import SessionError
from schemas.vectors import Vector

__all__ = ["Organ"]

_WORLD_BODY = -1
"""Bullet's number for no body: an anchor to the world does not move."""

_STILL = (0.0, 0.0, 0.0)
_HALTS = 24
"""Number of halts: each leaves some 1e-16 of a velocity, all together nothing of any possible velocity."""


class Organ:
    """The body in Bullet. Node i of the mesh is node i of Bullet's simulation mesh."""

    def __init__(
        self, name: str, params: OrganParams, client: int, parts: Mapping[str, int] | None = None
    ) -> None:
        """Load the organ into the world of `client`.

        `parts`: numbers of the rigid bodies for anchors, by name.
        """
        import pybullet as bullet

        self.name = name
        self.mesh = mesh = params.rest
        self.anchored = np.zeros(len(mesh.nodes), dtype=np.bool_)
        """Anchored nodes, shape (n,)."""
        for tied in params.anchored_nodes.values():
            self.anchored |= tied
        self.touchable = mesh.triangles[~self.anchored[mesh.triangles].all(axis=1)]
        self.held = np.zeros(len(mesh.nodes), dtype=np.bool_)
        """Nodes held by a grasp, shape (n,)."""
        self.origins = np.arange(len(mesh.nodes))
        """Node of the mesh at the resting place of each node, shape (n,)."""
        edges = mesh.nodes[mesh.triangles] - mesh.nodes[np.roll(mesh.triangles, 1, axis=1)]
        self.mean_edge = float(np.linalg.norm(edges, axis=2).mean())
        """Mean length of an edge of the surface, m."""
        self.frequency, lowest = params.frequencies
        """Highest natural frequency, rad/s."""
        self.period = 2.0 * np.pi / lowest if lowest else 0.0
        """Period of the slowest swing, s; 0 where nothing holds the organ."""
        self._client = client
        self._mesh_data = bullet.getMeshData
        self._flags = bullet.MESH_DATA_SIMULATION_MESH
        self._reach = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
        self._body = self._load(params)
        bullet.changeDynamics(
            self._body, -1, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client
        )
        bodies = {WORLD: _WORLD_BODY, **(parts or {})}
        for part, tied in params.anchored_nodes.items():
            for node in np.flatnonzero(tied).tolist():
                bullet.createSoftBodyAnchor(self._body, node, bodies[part], -1, physicsClientId=client)
        self.sample(0)

    def _load(self, params: OrganParams) -> int:
        """Load the mesh, and return Bullet's number of the body."""
        import pybullet as bullet

        mu, lambda_ = params.elastic.neo_hookean_lame
        with TemporaryDirectory(prefix="trocar-") as directory, quiet():
            path = Path(directory) / f"{self.name}.vtk"
            self.mesh.write_vtk(path)
            return bullet.loadSoftBody(
                str(path),
                mass=params.elastic.density * self.mesh.volume,
                collisionMargin=COLLISION_MARGIN_M,
                useNeoHookean=True,
                NeoHookeanMu=mu,
                NeoHookeanLambda=lambda_,
                NeoHookeanDamping=params.elastic.damping,
                useSelfCollision=False,
                useFaceContact=True,
                frictionCoeff=params.contact_friction,
                physicsClientId=self._client,
            )

    def anchor(self, node: int, body: int) -> int:
        """Tie a node to a rigid body of Bullet, where both are now; return the number of the anchor."""
        import pybullet as bullet

        self.held[node] = True
        return bullet.createSoftBodyAnchor(self._body, node, body, -1, physicsClientId=self._client)

    def release(self, node: int, anchor: int) -> None:
        """Undo `anchor`."""
        import pybullet as bullet

        bullet.removeConstraint(anchor, physicsClientId=self._client)
        self.held[node] = False

    def let_touch(self, body: int, *, on: bool) -> None:
        """Let a rigid body of Bullet collide with the organ, or pass through."""
        import pybullet as bullet

        bullet.setCollisionFilterPair(self._body, body, -1, -1, int(on), physicsClientId=self._client)

    def stand(self, nodes: Vector | None = None) -> None:
        """Bring all nodes to a standstill, at `nodes`, shape (n, 3), m in `world`, or in place.

        Bullet neither reads nor sets velocities of nodes; but setting an angular velocity replaces the
        velocity of every node by the rigid motion of the whole, and a linear velocity shifts all to a mean
        (`btSoftBody.cpp`). The remainder after each round is an error of rounding.
        """
        import pybullet as bullet

        if nodes is not None:
            bullet.resetMeshData(self._body, nodes.tolist(), physicsClientId=self._client)
        for _ in range(_HALTS):
            bullet.resetBaseVelocity(self._body, _STILL, _STILL, physicsClientId=self._client)

    def sample(self, time_ns: int) -> None:
        """Read the nodes into `nodes`, shape (n, 3), metres, frame `world`.

        Raises SessionError if the tissue has become unstable by `time_ns`.
        """
        count, nodes = self._mesh_data(self._body, -1, flags=self._flags, physicsClientId=self._client)
        self.nodes: Vector = np.fromiter(chain.from_iterable(nodes), np.float64, 3 * count).reshape(count, 3)
        moved = np.abs(self.nodes - self.mesh.nodes).max()
        if not moved < self._reach:
            raise SessionError(
                f"organ '{self.name}' became unstable by {time_ns * 1e-9:.6g} s: a node is {moved:.3g} m from"
                f" its place. {self._likely_cause(moved)}"
            )

    def _likely_cause(self, moved: float) -> str:
        if np.isfinite(moved) and not self.anchored.any():
            return "The likeliest cause is that it fell: nothing anchors it, and no rigid part lies under it"
        return (
            "The likeliest cause is a probe driven deep into it; else shorten the tissue's timestep, raise"
            " its damping, or lower the probe's stiffness"
        )
