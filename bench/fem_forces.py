"""Force over time of a blade, of scissors and of a tear in tissue of kind fem, beside the theory.

python bench/fem_forces.py [FIGURE]

Results: docs/decisions/0132-scissors-and-events.md.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from math import radians
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rigs

from engines.fem.solid import Solid, SphereWay
from engines.tissue.material import Material
from engines.tissue.meshing.grid import block
from schemas.vectors import Vector
from tests.engines.fem.test_cut import FIRM, STEP, TOUGHNESS, across, blade, draw, strip
from tests.engines.fem.test_scissors import OPEN, rig_of, turn

DEPTH = 5e-3
LIMIT = 1.6
LENGTH, WIDTH, THICKNESS = 0.04, 0.01, 0.004
FIGURE = "docs/pictures/cutting-force.png"

Curve = tuple[Vector, Vector, float, str]
"""Time, s, force, N, force by the theory, N, and title."""


def cut() -> Curve:
    """A vertical edge, 5 mm deep, through a block: toughness times width."""
    solid, edges = strip(mesh=block(np.array([0.03, 0.02, 0.01]), 2000)), blade()
    forces, work = draw(solid, edges, across(DEPTH))
    steady = -forces[150:250, 0]
    theory = TOUGHNESS * DEPTH
    print(
        f"blade: {steady.mean():.4f} N (standard deviation {steady.std():.4f}), theory {theory:.4f} N; work"
        f" {1e3 * work:.3f} mJ, toughness times cross-section {1e3 * TOUGHNESS * 0.03 * DEPTH:.3f} mJ"
    )
    return STEP * np.arange(len(forces)), -forces[:, 0], theory, "blade, 30 J/m², 5 mm"


def scissors() -> Curve:
    """Blades that close on a strip of 10 mm width: at most toughness times width on each."""
    with rig_of() as rig:
        forces = turn(rig, OPEN, radians(-10.0), 0.5).reshape(-1, 5, 3)[:, :2, 2].sum(axis=1)
        area, theory = rig.outputs["block/cut_area"][0], 200.0 * 10e-3
    print(f"scissors: at most {forces.max():.3f} N, theory {theory:.3f} N; swept {1e6 * area:.1f} of 40 mm^2")
    return 1e-3 * np.arange(len(forces)), forces, theory, "scissors, 200 J/m², 10 mm"


def nominal_stress(material: Material, stretch: float) -> float:
    """Return the stress (Pa) of free uniaxial tension, by the engine's energy."""
    mu, lambda_ = material.neo_hookean_lame
    offset = 1.0 + mu / lambda_ - mu / (4.0 * lambda_)
    low, high = 0.1, 1.0
    for _ in range(60):  # the stress across falls to 0 as the strip gets thinner
        side = 0.5 * (low + high)
        shear = mu * (1.0 - 1.0 / (stretch**2 + 2.0 * side**2 + 1.0))
        across_it = shear * side + lambda_ * (stretch * side**2 - offset) * stretch * side
        low, high = (low, side) if across_it > 0.0 else (side, high)
    return shear * stretch + lambda_ * (stretch * side**2 - offset) * side**2


def tear() -> Curve:
    """A strip between clamps, pulled apart at 20 mm/s: stress at the limit times cross-section."""
    mesh = block(np.array([LENGTH, WIDTH, THICKNESS]), 900)
    x = mesh.nodes[:, 0]
    solid = Solid(mesh, x < x.min() + 1e-9, FIRM, divisible=True)
    for node in np.flatnonzero(x > x.max() - 1e-9).tolist():
        solid.hold(node, 0)
    forces, torn = list[float](), 0
    way = np.linspace(0.0, 1.4 * (LIMIT - 1.0) * LENGTH, 1600)
    for before, after in pairwise(way):
        path = np.zeros((solid.sub_steps(STEP) + 1, 1, 3))
        path[:, 0, 0] = np.linspace(before, after, len(path))
        found = solid.advance(STEP, SphereWay(path, np.full(1, 1e-3), np.zeros(1, np.uint8)), 0.0, 0.0)
        forces.append(-float(found[:, 0, 0].mean()))
        if len(forces) % 8 == 0:
            torn += solid.tear(LIMIT)
    theory = nominal_stress(FIRM, LIMIT) * WIDTH * THICKNESS
    most = int(np.argmax(forces))
    print(
        f"tear: at most {max(forces):.3f} N at a mean stretch of {1.0 + way[most] / LENGTH:.3f}, theory"
        f" {theory:.3f} N at {LIMIT}; {torn} faces opened, {solid.pieces.max() + 1} pieces"
    )
    return STEP * np.arange(len(forces)), np.array(forces), theory, f"tear at a stretch of {LIMIT}"


def main() -> None:
    """Print all forces and draw them."""
    mpl.use("Agg")
    from matplotlib import pyplot

    plot: Any = pyplot
    figure, panels = plot.subplots(1, 3, figsize=(11.0, 3.2), layout="constrained")
    for axes, (time, force, theory, title) in zip(panels, (cut(), scissors(), tear()), strict=True):
        axes.plot(time, force, linewidth=1.0)
        axes.axhline(theory, color="0.3", linestyle="--", linewidth=1.0, label="theory")
        axes.set(title=title, xlabel="time (s)", ylabel="force (N)")
        axes.legend(frameon=False)
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else FIGURE, dpi=110)


if __name__ == "__main__":
    main()
