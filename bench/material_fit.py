"""A picture of a material that was fitted to a press: the force, and how it relaxes, with their bands.

python bench/material_fit.py docs/pictures/material-fit.png

The press is that of docs/decisions/0073-calibrated-tissue.md, synthetic with noise of 2 % of the largest
force. The bands hold 95 of 100 fits: they are the means and two deviations of the fits of 30 presses that
differ in their noise.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' press

from engines.bullet.calibration.fit import calibrate
from schemas.vectors import Vector
from tests.engines.bullet.calibration.test_calibration import LIVER, SPHERE, pressed

SEEDS, NOISE = 30, 0.02
MODULUS_PA = 8e3


def band(axis: Any, time: Vector, curves: Vector) -> None:
    """Draw mean and two deviations of curves, shape (k, n)."""
    mean, spread = curves.mean(axis=0), 2.0 * curves.std(axis=0, ddof=1)
    axis.fill_between(time, mean - spread, mean + spread, color="C0", alpha=0.3, label="95 % of fits")


def main(path: Path) -> None:
    """Fit all presses, and draw."""
    presses = [pressed(seed=seed, noise=NOISE) for seed in range(SEEDS)]
    found = [calibrate(one, SPHERE) for one in presses]
    first, after = presses[0], np.geomspace(0.05, 20.0, 200)
    step = np.ones_like(after)
    figure: Any = Figure(figsize=(9, 3.2), layout="constrained")
    press, relaxation = figure.subplots(1, 2)
    press.plot(first.time, first.force, ".", color="0.6", markersize=3, label="measured")
    press.plot(first.time, found[0].predicted, color="C0", label="fitted")
    band(press, first.time, np.array([one.predicted for one in found]))
    press.set(xlabel="time, s", ylabel="force, N")

    def kept(shares: tuple[float, ...], times: tuple[float, ...]) -> Vector:
        return step - sum(g * (1.0 - np.exp(-after / tau)) for g, tau in zip(shares, times, strict=True))

    def modulus(young: float, prony: Any) -> Vector:
        return young * kept(prony.shares, prony.times) / 1e3

    relaxation.plot(after, modulus(MODULUS_PA, LIVER), "k--", label="true")
    relaxation.plot(after, modulus(found[0].young_modulus, found[0].relaxation), color="C0", label="fitted")
    band(relaxation, after, np.array([modulus(one.young_modulus, one.relaxation) for one in found]))
    relaxation.set(xlabel="time after a sudden press, s", ylabel="Young's modulus, kPa", xscale="log")
    for axis in (press, relaxation):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
