"""An organ: an anchored body of soft tissue, and the spheres that hold its nodes."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from xxhash import xxh3_128_digest

from engines.fem.solid import Branch, Solid, SphereWay
from engines.fem.spheres import Spheres
from engines.tissue.organs.params import OrganParams
from schemas.errors import SessionError
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["Organ", "relaxation"]

_VISCOUS_SHARE = 1.0
"""Shear modulus of the branch for `damping`, over that of the material. The damping of a branch is modulus
times relaxation time: up to the frequency 1 / damping that of stiffness-proportional damping.
"""
_SETTLED_PERIODS = 3.0
"""Time of settling under weight, in periods of the slowest swing, which drag damps critically."""
_LEAST_SETTLING_S = 0.1
_NO_SPHERES = np.zeros(0), np.zeros(0, np.uint8)


def relaxation(params: OrganParams) -> list[Branch]:
    """Return the branches of the organ's Prony series."""
    remaining = 1.0 - plain_sum(term.share for term in params.series)
    return [Branch(term.share / remaining, term.seconds) for term in params.series]


class Organ:
    """Tissue of one name."""

    def __init__(self, name: str, params: OrganParams) -> None:
        self.name, self.mesh = name, params.rest
        self.anchored: NDArray[np.bool_] = np.zeros(len(self.mesh.nodes), dtype=np.bool_)
        for tied in params.anchored_nodes.values():
            self.anchored |= tied
        self.touchable = self.mesh.triangles[~self.anchored[self.mesh.triangles].all(axis=1)]
        edges = (
            self.mesh.nodes[self.mesh.triangles] - self.mesh.nodes[np.roll(self.mesh.triangles, 1, axis=1)]
        )
        self.mean_edge = float(np.linalg.norm(edges, axis=2).mean())
        self.friction = params.contact_friction
        material = params.relaxed
        branches = [Branch(_VISCOUS_SHARE, material.damping)] if material.damping else []
        branches += relaxation(params)
        self.solid = Solid(self.mesh, self.anchored, self.touchable, material, branches)
        self._inverse_mass = self.solid.inverse_mass.copy()
        self._slowest = params.frequencies[1]
        self._free = np.ones(0, np.uint8)
        self._reach = float(np.linalg.norm(np.ptp(self.mesh.nodes, axis=0)))
        self.nodes: Vector = self.mesh.nodes

    @property
    def held(self) -> NDArray[np.bool_]:
        """Nodes held by a grasp, shape (n,)."""
        return self.solid.holder >= 0

    def settle(self, gravity: float) -> None:
        """Let the organ come to rest under its weight (m/s^2, along -z)."""
        if self._slowest is None:
            return
        duration = max(_LEAST_SETTLING_S, _SETTLED_PERIODS * 2.0 * np.pi / self._slowest)
        sub_steps = self.solid.sub_steps(duration)
        way = SphereWay(np.zeros((sub_steps + 1, 0, 3)), *_NO_SPHERES)
        self.solid.advance(duration, way, 0.0, gravity, drag=2.0 * self._slowest)
        self.solid.stand()
        self.sample(0)

    def advance(self, seconds: float, gravity: float) -> Vector:
        """Advance; return the force on each sphere in each sub-step, N, shape (k, n, 3)."""
        return self.solid.advance(seconds, self._way, self.friction, gravity)

    def sample(self, time_ns: int) -> None:
        """Read the nodes. Raises SessionError if the tissue has become unstable by `time_ns`."""
        self.nodes = self.solid.nodes
        moved = float(np.abs(self.solid.displacement[:, :3]).max())
        if not moved < self._reach:
            raise SessionError(
                f"organ '{self.name}' became unstable by {time_ns * 1e-9:.6g} s: a node is {moved:.3g} m from"
                " its place. The likeliest cause is an instrument that went through it; else shorten the"
                " tissue's timestep"
            )

    def anchor(self, node: int, body: int) -> int:
        """Tie a node to a sphere; return the node."""
        self.solid.holder[node] = body
        self.solid.inverse_mass[node] = 0.0
        return node

    def release(self, node: int, anchor: int) -> None:  # noqa: ARG002  a tie is its node
        """Undo `anchor`."""
        self.solid.holder[node] = -1
        self.solid.inverse_mass[node] = self._inverse_mass[node]

    def let_touch(self, body: int, *, on: bool) -> None:
        """Let a sphere press the organ, or pass through."""
        self._free[body] = on

    def meet(self, spheres: Spheres) -> None:
        """Let these spheres press the organ."""
        self._free = np.ones(len(spheres.radii), np.uint8)
        self._way = SphereWay(spheres.path, spheres.radii, self._free)

    def held_by(self, bodies: Collection[int]) -> list[int]:
        """Return the nodes that these spheres hold."""
        return np.flatnonzero(np.isin(self.solid.holder, list(bodies))).tolist()

    @property
    def digest(self) -> bytes:
        """16 bytes by the displacements."""
        return xxh3_128_digest(self.solid.displacement.tobytes())

    @property
    def state(self) -> tuple[NDArray[np.float32] | NDArray[np.int32] | NDArray[np.uint8], ...]:
        """Arrays that the next step depends on, to be written."""
        return *self.solid.state, self.solid.holder, self.solid.inverse_mass, self._free
