"""Temperature under a moving hook in tissue of kind fem, beside that of a point current.

python bench/fem_burn.py [FIGURE]

Results: docs/decisions/0134-energy-instruments.md.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from scipy.ndimage import gaussian_filter

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rigs

from engines.fem.heat.tissue import TISSUES
from schemas.vectors import Vector
from tests.engines.fem.heat.test_instrument import RADIUS, CauteryRig

SLAB = {"size": ["30 mm", "16 mm", "8 mm"], "young_modulus": "10 kPa", "nodes": 4600}
SPEED, HALF, HEIGHT = 5e-3, 8e-3, RADIUS - 0.5e-3
REACH = 4.0 * RADIUS + 1e-3
"""Distance from the electrode within which the model heats, m: four radii and an edge."""
FIGURE = "docs/pictures/burn.png"


def burn(watts: float) -> tuple[Vector, Vector]:
    """Return resting nodes, m, shape (n, 3), and temperatures, degrees C, shape (n,), of a track."""
    start = (-HALF, 0.0, HEIGHT)
    with CauteryRig(SLAB, start=start) as rig:
        rig.move(start, 0.05)
        rig.watts[:] = watts
        rig.move((HALF, 0.0, HEIGHT), 2.0 * HALF / SPEED)
        boiled = 1e6 * rig.heat.book[2] / 2.257e6
        print(
            f"{watts:g} W: {rig.number('probe/delivered'):.1f} J in tissue, {boiled:.2f} mg boiled, hottest"
            f" {rig.number('block/hottest'):.0f} degrees C"
        )
        return rig.engine._organs[0].mesh.nodes, rig.heat.temperature


def passing_current(depths: Vector, watts: float) -> Vector:
    """Return the rise (K) at depths (m), where a point current has passed a while ago.

    Its heat is as the square of its density, 1 / r^4 outside of the electrode, within the reach of the model;
    the heat then spreads across the track, below an insulated surface.
    """
    step, tissue, seconds = 5e-5, TISSUES["liver"], HALF / SPEED
    x = np.arange(-REACH, REACH, step) + 0.5 * step
    z = np.arange(-2.0 * REACH, 0.0, step) + 0.5 * step
    square = x[:, None] ** 2 + (z - HEIGHT) ** 2
    across = np.zeros_like(square)
    for way in x.tolist():
        away = square + way**2
        across += np.where(away < REACH**2, np.maximum(away, RADIUS**2) ** -2, 0.0)
    across *= watts / (SPEED * tissue.capacity * across.sum() * step**2)
    width = np.sqrt(2.0 * tissue.conductivity / tissue.capacity * seconds) / step
    across = gaussian_filter(across, width, mode="reflect")
    return np.interp(-depths, z, across[len(x) // 2])


def main() -> None:
    """Print the heat, and draw fields and profiles."""
    mpl.use("Agg")
    from matplotlib import pyplot

    plot: Any = pyplot
    figure, (field, profile) = plot.subplots(1, 2, figsize=(11.0, 3.2), layout="constrained")
    nodes, hot = burn(30.0)
    middle = np.abs(nodes[:, 1]) < 1e-9
    x, z = 1e3 * nodes[middle, 0], 1e3 * nodes[middle, 2]
    drawn = field.tricontourf(
        x, z, hot[middle], levels=np.arange(37.0, 106.0, 7.0), cmap="inferno", extend="max"
    )
    field.tricontour(x, z, hot[middle], levels=[60.0], colors="white", linewidths=1.0)
    figure.colorbar(drawn, ax=field, label="degrees C")
    field.set(title="30 W at 5 mm/s; white: 60 degrees", xlabel="x (mm)", ylabel="z (mm)", aspect="equal")
    nodes, warm = burn(2.0)
    below = np.abs(nodes[:, :2]).max(axis=1) < 1e-9
    depths, rises = -nodes[below, 2], warm[below] - 37.0
    theory = passing_current(np.linspace(0.0, 5e-3, 100), 1.0)
    profile.semilogy(1e3 * depths, rises, "o", label="kind fem")
    profile.semilogy(np.linspace(0.0, 5.0, 100), theory, "--", color="0.3", label="point current")
    for depth, rise, truth in zip(depths, rises, passing_current(depths, 1.0), strict=True):
        print(f"{1e3 * depth:g} mm deep: {rise:.2f} K, point current {truth:.2f} K")
    profile.set(
        title="2 W, 1 W in tissue", xlabel="depth (mm)", ylabel="rise (K)", xlim=(0.0, 5.0), ylim=(0.05, 50.0)
    )
    profile.legend(frameon=False)
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else FIGURE, dpi=110)


if __name__ == "__main__":
    main()
