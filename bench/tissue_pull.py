"""How stiff tissue is that is held by a patch of its surface and lifted: the mesh beside converged elements.

python bench/tissue_pull.py

The top of a block of 80 x 60 x 20 mm and 10 kPa. Converged: a round patch as wide as a jaw, on a disc of
the same thickness (bench/tissue_truth.py, which needs scikit-fem). The mesh: the nodes that a grasp takes
with two spheres side by side, moved alike, by Newton's method; and with the spring in series that
`grasp.width` gives it. Results: docs/decisions/0095-converged-truth.md, 0099-rims-and-held-patches.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from skfem import MeshTri

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' truth

from bench.tissue_force import places
from bench.tissue_truth import BLOCK, STANDARD_GRAVITY, axisymmetric, graded
from engines.tissue.elasticity.compliance import SurfaceCompliance
from engines.tissue.probes.held_patch import patch_at
from schemas.vectors import Vector
from tests.engines.bullet import rig
from tests.engines.bullet.finite_elements import Body, equilibrium

NODES = (250, 600, 1000)
PADS_M = (2e-3, 3e-3)
"""Radius of the round patch; two spheres of half of it touch side by side."""
LIFT_M, DISC_M, THICK_M = 2e-3, 39.1e-3, 20e-3


def converged(patch: float) -> float:
    """Return force over lift (N/m) of a round patch of radius `patch` (m)."""
    inside = np.concatenate([np.linspace(0.0, 0.8, 5), [0.88, 0.94, 0.976]]) * patch
    r = np.concatenate([inside, patch + graded(0.03, DISC_M / patch - 1.0, 1.35, 0.05) * patch])
    z = graded(0.06, THICK_M / patch, 1.35, 0.3) * patch
    solid = axisymmetric(MeshTri.init_tensor(r, -z[::-1]), BLOCK, STANDARD_GRAVITY)
    solid.settle()
    held = np.flatnonzero((solid.rest[:, 1] > -1e-9) & (solid.rest[:, 0] < patch + 1e-9))
    solid.hold(np.concatenate([2 * held, 2 * held + 1]))
    steps = int(np.ceil(LIFT_M / (0.2 * patch)))
    for _ in range(steps):
        solid.moved[2 * held + 1] += LIFT_M / steps
        solid.settle()
    return float(solid.residual[2 * held + 1].sum()) / LIFT_M


def of_mesh(nodes: int, place: str, pad: float) -> tuple[int, float, float]:
    """Return how many nodes are held, and force over lift (N/m): of the mesh, and with `grasp.width`."""
    organ = rig.params({**rig.BLOCK, "nodes": nodes}).organs["block"]
    body, rest, faces = Body(organ), organ.rest.nodes, organ.rest.triangles
    edges = np.linalg.norm(rest[faces] - rest[np.roll(faces, 1, axis=1)], axis=2)
    at = places(rest, faces, np.zeros(3))[place]
    spheres = at + np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]]) * pad
    away: Vector = np.linalg.norm(rest[:, None] - spheres, axis=2).min(axis=1) - 0.5 * pad
    held = (away <= edges.mean() / np.sqrt(3.0)) & ~body.fixed
    lifted = body.nodes + np.where(held[:, None], [0.0, 0.0, LIFT_M], 0.0)
    lifted, _ = equilibrium(body.elements, lifted, body.fixed | held, body.load)
    force = -(body.elements.forces(lifted) + body.load)[held, 2].sum()
    stiffness = float(force) / LIFT_M
    surface = SurfaceCompliance(organ.rest, body.fixed, faces, organ.elastic)
    missing = patch_at(surface, organ.elastic, np.flatnonzero(held), 2.0 * pad).missing
    return int(held.sum()), stiffness, 1.0 / (1.0 / stiffness + max(float(missing[2, 2]), 0.0))


def main() -> None:
    """Print the table."""
    for pad in PADS_M:
        true = converged(pad)
        print(f"jaw {2e3 * pad:g} mm wide, converged: {true:.1f} N/m", flush=True)
        for nodes in NODES:
            for place in ("node", "face"):
                held, found, given = of_mesh(nodes, place, pad)
                where, times = f"{nodes:4} nodes, over a {place}", f"{found / true:.1f} times"
                with_width = f"with width {given:.1f} N/m, {given / true:.2f} times"
                print(f"  {where}: {held} held, {found:.1f} N/m, {times}; {with_width}", flush=True)


if __name__ == "__main__":
    main()
