"""An organ: an anchored block of soft tissue in a Bullet world."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from engines.bullet.client import quiet
from engines.bullet.contact import contact_gain
from engines.bullet.material import Material, highest_frequency
from engines.bullet.mesh import FEWEST_NODES, TetMesh, block, block_cells
from schemas.errors import SessionError
from schemas.quantity import Density, Duration, Length, Pressure
from schemas.vectors import Vector

__all__ = ["Organ", "OrganParams"]

_COLLISION_MARGIN_M = 1e-4
"""Distance at which Bullet lets contact begin; the force at a given depth is too high by about what this adds to the depth."""

Edge = Annotated[Length, Field(gt=0)]


class OrganParams(BaseModel):
    """A block of tissue, its edges along the axes of `world`, at rest on what anchors it. SI units after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    size: tuple[Edge, Edge, Edge] = Field(description="edge lengths along x, y, z")
    young_modulus: Pressure = Field(gt=0)
    poisson_ratio: float = Field(default=0.4, gt=0, lt=0.5)
    density: Density = Field(default=1000.0, gt=0, description="default: water")
    nodes: int = Field(default=250, ge=FEWEST_NODES, le=5000, description="about how many; about 250 run in real time at sub-steps of 1 ms")
    position: tuple[Length, Length, Length] = Field(default=(0.0, 0.0, 0.0), description="centre of the top face in `world`")
    anchors: Literal["bottom"] = Field(default="bottom", description="which nodes are fixed in `world`")
    damping: Duration = Field(default=1_000_000, ge=0, description="stiffness-proportional damping: ratio of damping to stiffness, a time")
    friction: float = Field(default=0.3, ge=0, le=2, description="Coulomb coefficient against probes")

    @property
    def material(self) -> Material:
        """The material."""
        return Material(self.young_modulus, self.poisson_ratio, self.density, self.damping * 1e-9)

    @property
    def mesh(self) -> TetMesh:
        """The mesh at rest, in `world`."""
        mesh = block(np.array(self.size), self.nodes)
        return TetMesh(mesh.nodes + np.array(self.position), mesh.tetrahedra)

    def contact_stiffness(self, radius: float) -> float:
        """Estimate the stiffness (N/m) against a sphere of `radius` (m): that of a punch as wide as the sphere, or as a cell of the mesh."""
        cell = np.array(self.size) / block_cells(np.array(self.size), self.nodes)
        return self.material.contact_stiffness(max(radius, float(cell[:2].max())))


class Organ:
    """The body in Bullet. Node i of the mesh is node i of Bullet's simulation mesh."""

    def __init__(self, name: str, params: OrganParams, client: int) -> None:
        """Load the organ into the world of `client`."""
        import pybullet as bullet

        self.name = name
        self.mesh = mesh = params.mesh
        self.anchored = mesh.nodes[:, 2] == mesh.nodes[:, 2].min()
        self.touchable = mesh.triangles[~self.anchored[mesh.triangles].all(axis=1)]
        self.held = np.zeros(len(mesh.nodes), dtype=np.bool_)
        """Which nodes are held by a grasp, shape (n,)."""
        edges = mesh.nodes[mesh.triangles] - mesh.nodes[np.roll(mesh.triangles, 1, axis=1)]
        self.mean_edge = float(np.linalg.norm(edges, axis=2).mean())
        """Mean length of an edge of the surface, m."""
        self.frequency = highest_frequency(mesh, np.where(self.anchored, 0.0, 1.0), params.material)
        """Highest natural frequency, rad/s."""
        self._client = client
        self._mesh_data = bullet.getMeshData
        self._flags = bullet.MESH_DATA_SIMULATION_MESH
        self._reach = float(np.linalg.norm(params.size))
        mu, lambda_ = params.material.bullet_lame
        with TemporaryDirectory(prefix="trocar-") as directory, quiet():
            path = Path(directory) / f"{name}.vtk"
            mesh.write_vtk(path)
            self._body = bullet.loadSoftBody(
                str(path),
                mass=params.density * float(np.prod(params.size)),
                collisionMargin=_COLLISION_MARGIN_M,
                useNeoHookean=True,
                NeoHookeanMu=mu,
                NeoHookeanLambda=lambda_,
                NeoHookeanDamping=params.material.damping,
                useSelfCollision=False,
                useFaceContact=True,
                frictionCoeff=params.friction,
                physicsClientId=client,
            )
        bullet.changeDynamics(self._body, -1, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client)
        for node in np.flatnonzero(self.anchored).tolist():
            bullet.createSoftBodyAnchor(self._body, node, -1, -1, physicsClientId=client)
        self.sample(0)

    def contact_gain(self, centre: Vector, radius: float) -> float:
        """Return `contact.contact_gain` for a sphere at `centre` (m), shape (3,), of `radius` (m), on the nodes as last read."""
        return contact_gain(centre, radius, self.nodes, self.touchable)

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
        """Say whether a rigid body of Bullet meets the organ, or passes through it."""
        import pybullet as bullet

        bullet.setCollisionFilterPair(self._body, body, -1, -1, int(on), physicsClientId=self._client)

    def sample(self, time_ns: int) -> None:
        """Read the nodes into `nodes`, shape (n, 3), metres, frame `world`.

        Raises SessionError if the tissue has become unstable by `time_ns`.
        """
        count, nodes = self._mesh_data(self._body, -1, flags=self._flags, physicsClientId=self._client)
        self.nodes: Vector = np.fromiter(chain.from_iterable(nodes), np.float64, 3 * count).reshape(count, 3)
        moved = np.abs(self.nodes - self.mesh.nodes).max()
        if not moved < self._reach:
            raise SessionError(
                f"organ '{self.name}' became unstable by {time_ns * 1e-9:.6g} s: a node is {moved:.3g} m from its place. The likeliest cause is a probe driven "
                f"deep into it; else shorten the tissue's timestep, raise its damping, or lower the probe's stiffness"
            )
