"""Energy book of tissue of kind fem: a block is pressed, pulled, and let go.

python bench/fem_energy.py

Work of the instruments beside the stored and the lost, sub-step by sub-step, in double precision.
Results: docs/decisions/0125-tissue-of-our-own.md.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from engines.fem.solid import Branch, Solid, SphereWay
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block

MATERIAL = Material(10e3, 0.4, 1000.0, 1e-3)
GRAVITY = 9.80665
SIZE_M = np.array([0.08, 0.06, 0.02])


class Book:
    """A block with its energies, J."""

    def __init__(self, nodes: int, friction: float) -> None:
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
        self.work = self.viscous = self.contact = 0.0
        self.k = solid.sub_steps(1e-3)
        self.dt = 1e-3 / self.k

    def elastic(self) -> tuple[float, np.ndarray]:
        """Return elastic energy and Green strains."""
        u = self.solid.displacement[:, :3].astype(float)
        F = np.eye(3) + np.einsum("mai,maj->mij", u[self.corners], self.gradients)
        J, trace = np.linalg.det(F), np.einsum("mij,mij->m", F, F)
        density = 0.5 * self.mu * (trace - 3.0 - np.log((trace + 1.0) / 4.0)) - 0.75 * self.mu * (J - 1.0)
        mean = np.bincount(self.corners.ravel(), np.repeat(self.volume * J, 4), len(u)) / self.around
        strain = 0.5 * (np.einsum("mki,mkj->mij", F, F) - np.eye(3))
        return float(self.volume @ density + 0.125 * self.bulk * (self.around @ (mean - 1.0) ** 2)), strain

    def branch(self, strain: np.ndarray) -> float:
        """Return the energy of the viscous branch."""
        e = self.solid.strains[0].transpose(0, 2, 1).reshape(-1, 6).astype(float)
        apart = strain - e[:, [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]
        apart -= np.eye(3) * np.trace(apart, axis1=1, axis2=2)[:, None, None] / 3.0
        return 0.75 * self.mu * float(self.volume @ np.einsum("mij,mij->m", apart, apart))

    def stored(self) -> dict[str, float]:
        """Return what is stored now."""
        elastic, strain = self.elastic()
        return {
            "elastic": elastic,
            "branch": self.branch(strain),
            "kinetic": 0.5 * float(self.mass @ (self.solid.velocity[:, :3].astype(float) ** 2).sum(axis=1)),
            "weight": GRAVITY * float(self.mass @ self.solid.displacement[:, 2]),
        }

    def sub_step(self, before: np.ndarray, after: np.ndarray, radii: np.ndarray, free: np.ndarray) -> None:
        """Advance by one sub-step, spheres from `before` to `after`; write up work and losses."""
        solid, dt = self.solid, self.dt
        _, strain = self.elastic()
        old, velocity = self.branch(strain), solid.velocity[:, :3].astype(float)
        forces = solid.advance(dt, SphereWay(np.stack([before, after]), radii, free), self.friction, GRAVITY)[
            0
        ]
        self.viscous += old - self.branch(strain)
        mass, now = self.mass[:, None], solid.velocity[:, :3].astype(float)
        freely = velocity + dt * (solid.force[:, :3] / mass - np.array([0.0, 0.0, GRAVITY]))
        impulse = np.where(self.fixed[:, None], 0.0, mass * (now - freely))
        work = -float((forces * (after - before)).sum())
        self.work += work
        self.contact += work - float((impulse * 0.5 * (freely + now)).sum())


class Motion:
    """A pressing sphere and a jaw beside it, and the largest elastic energy so far."""

    def __init__(self, friction: float) -> None:
        self.book = Book(250, friction)
        self.first, self.largest = self.book.stored(), 0.0
        self.at = np.array([[0.0, 0.0, 6e-3], [0.02, 0.0, 0.0]])
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

    def say(self, what: str) -> None:
        """Print the book."""
        book = self.book
        now = {key: value - self.first[key] for key, value in book.stored().items()}
        self.largest = max(self.largest, now["elastic"])
        all_lines = {"work": book.work, **now, "viscous": book.viscous, "contact": book.contact}
        rest = book.work - sum(all_lines.values()) + book.work
        line = ", ".join(f"{key} {1e6 * value:.2f}" for key, value in all_lines.items())
        print(f"friction {book.friction}, {what}: {line} uJ; left {rest / self.largest:+.3%}")


def main() -> None:
    """Print the book after each part of the motion."""
    for friction in (0.0, 0.3):
        motion, jaw = Motion(friction), (0.02, 0.0, 0.0)
        motion.go((0.0, 0.0, 2e-3), jaw, seconds=0.1)
        motion.go((0.0, 0.0, 2e-3), jaw, seconds=0.05)
        motion.say("pressed")
        motion.go((5e-3, 0.0, 2e-3), jaw, seconds=0.1)
        motion.say("dragged")
        motion.take()
        motion.go((5e-3, 0.0, 8e-3), (0.02, 0.0, 4e-3), seconds=0.1)
        motion.say("pulled")
        motion.let_go()
        motion.go((5e-3, 0.0, 8e-3), (0.02, 0.0, 4e-3), seconds=0.3)
        motion.say("let go")


if __name__ == "__main__":
    main()
