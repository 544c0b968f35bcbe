"""Energy book of a block of tissue that is pressed and pulled, sub-step by sub-step, in double precision."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from engines.fem.solid import Branch, Solid, SphereWay
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block

MATERIAL = Material(10e3, 0.4, 1000.0, 1e-3)
GRAVITY = 9.80665
JAW, LIFTED = (0.02, 0.0, 0.0), (0.02, 0.0, 4e-3)
SIZE_M = np.array([0.08, 0.06, 0.02])


class Book:
    """A block with its energies, J."""

    def __init__(self, nodes: int, friction: float, finer: int) -> None:
        mesh = block(SIZE_M, nodes)
        self.fixed = mesh.nodes[:, 2] < -SIZE_M[2] + 1e-9
        self.solid = solid = Solid(mesh, self.fixed, MATERIAL, [Branch(1.0, 1e-3)])
        self.mu, self.bulk = MATERIAL.neo_hookean_lame
        self.friction = friction
        self.corners, gradients, self.volume = solid.elements
        gradients = gradients.reshape(-1, 3, 3)
        self.gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
        self.around = np.bincount(self.corners.ravel(), np.repeat(self.volume, 4), len(mesh.nodes))
        self.mass = solid.mass.astype(float)
        self.work = self.viscous = self.rubbed = self.lagging = 0.0
        self.moved = np.zeros((2, 3))
        self.F = self.strain = np.zeros((0, 3, 3))
        self.dt = 1e-3 / (finer * solid.sub_steps(1e-3))

    def deform(self) -> np.ndarray:
        """Set deformation gradients and Green strains of the present places; return the displacements, m."""
        u = self.solid.displacement[:, :3].astype(float)
        self.F = np.eye(3) + np.einsum("mai,maj->mij", u[self.corners], self.gradients)
        self.strain = 0.5 * (np.einsum("mki,mkj->mij", self.F, self.F) - np.eye(3))
        return u

    def elastic(self) -> float:
        """Return the elastic energy at the strains that are set."""
        J, trace = np.linalg.det(self.F), np.einsum("mij,mij->m", self.F, self.F)
        density = 0.5 * self.mu * (trace - 3.0 - np.log((trace + 1.0) / 4.0)) - 0.75 * self.mu * (J - 1.0)
        mean = np.bincount(self.corners.ravel(), np.repeat(self.volume * J, 4)) / self.around
        return float(self.volume @ density + 0.125 * self.bulk * (self.around @ (mean - 1.0) ** 2))

    def apart(self) -> np.ndarray:
        """Return the deviatoric strain of the viscous branch's spring."""
        e = self.solid.strains[0].transpose(0, 2, 1).reshape(-1, 6).astype(float)
        apart = self.strain - e[:, [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]
        return apart - np.eye(3) * np.trace(apart, axis1=1, axis2=2)[:, None, None] / 3.0

    def branch(self) -> float:
        """Return the energy of the viscous branch."""
        apart = self.apart()
        return 0.75 * self.mu * float(self.volume @ np.einsum("mij,mij->m", apart, apart))

    def stored(self) -> dict[str, float]:
        """Return the stored energies."""
        self.deform()
        return {
            "elastic": self.elastic(),
            "branch": self.branch(),
            "kinetic": 0.5 * float(self.mass @ (self.solid.velocity[:, :3].astype(float) ** 2).sum(axis=1)),
            "weight": GRAVITY * float(self.mass @ self.solid.displacement[:, 2]),
        }

    def sub_step(self, before: np.ndarray, after: np.ndarray, radii: np.ndarray, free: np.ndarray) -> None:
        """Advance by one sub-step, spheres from `before` to `after`; write up work and losses.

        A force acts between two sub-steps, so it does work along the halves of both. `lagging` is the work
        along the whole of the later one, as an instrument counts it.
        """
        solid, dt, mass = self.solid, self.dt, self.mass[:, None]
        place, old = self.deform(), self.branch()
        velocity = solid.velocity[:, :3].astype(float)
        forces = solid.advance(dt, SphereWay(np.stack([before, after]), radii, free), self.friction, GRAVITY)[
            0
        ]
        drawn = 1.5 * self.mu * np.einsum("m,mij,mjk->mik", self.volume, self.F, self.apart())
        by_branch = np.zeros_like(place)
        np.add.at(by_branch, self.corners, -np.einsum("mij,maj->mai", drawn, self.gradients))
        now = solid.velocity[:, :3].astype(float)
        way = 0.5 * dt * (velocity + now)
        pushed = mass * (now - velocity) / dt - solid.force[:, :3] + mass * np.array([0.0, 0.0, GRAVITY])
        pushed[self.fixed] = 0.0
        self.deform()
        moved = after - before
        work = -float((forces * 0.5 * (self.moved + moved)).sum())
        self.work += work
        self.lagging -= float((forces * moved).sum())
        self.moved = moved
        self.viscous -= float((by_branch * way).sum()) + self.branch() - old
        self.rubbed += work - float((pushed * way).sum())


class Motion:
    """A pressing sphere and a jaw beside it, and the largest elastic energy so far."""

    def __init__(self, nodes: int, friction: float, finer: int = 1) -> None:
        self.book = Book(nodes, friction, finer)
        self.first, self.largest = self.book.stored(), 0.0
        self.at = np.array([[-0.02, 0.0, 6e-3], JAW])
        self.held: list[int] = []

    def go(self, *target: tuple[float, float, float], seconds: float) -> None:
        """Move sphere and jaw to `target`, m."""
        places = np.linspace(self.at, np.array(target), round(seconds / self.book.dt) + 1)
        for before, after in pairwise(places):
            self.book.sub_step(before, after, np.full(2, 5e-3), np.array([1, 0], np.uint8))
        self.at = places[-1]

    def take(self) -> None:
        """Close the jaw."""
        solid = self.book.solid
        near = np.linalg.norm(solid.nodes - self.at[1], axis=1) < 0.012
        self.held = np.flatnonzero(near & (solid.inverse_mass > 0.0)).tolist()
        for node in self.held:
            solid.hold(node, 1)

    def let_go(self) -> None:
        """Open the jaw."""
        for node in self.held:
            self.book.solid.let_go(node)

    def left(self) -> tuple[dict[str, float], float]:
        """Return work, stored and lost energies, and the rest over the largest elastic energy."""
        book = self.book
        now = {key: value - self.first[key] for key, value in book.stored().items()}
        self.largest = max(self.largest, now["elastic"])
        lines = {"work": book.work, **now, "viscous": book.viscous, "rubbed": book.rubbed}
        return lines, (2.0 * book.work - sum(lines.values())) / self.largest
