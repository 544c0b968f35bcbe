"""How much of the force of a contact a long sub-step of the tissue takes, over a node and over a face.

A block of 80 x 60 x 20 mm and some 250 nodes is pressed at sub-steps of 1 ms; its modulus sets its highest
frequency w, and with it the product h w that stability depends on. The reference is Newton's method on the
same mesh (bench/indentation.py). Results: docs/decisions/0088-limits-of-the-model.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from bench.indentation import places
from engines.bullet.elasticity.stable_step import face_loss
from engines.bullet.params import BulletParams
from engines.tissue.frequencies import highest_frequency
from schemas.vectors import Vector
from tests.engines.bullet import rig
from tests.engines.bullet.finite_elements import Body

PHASES = (1.2, 1.6, 2.0, 2.5, 3.0, 3.5, 3.9)
RADII_M = (2e-3, 5e-3)
DEPTHS_M: Vector = np.array([1e-3, 3e-3])
STEP_S = 1e-3


def params(young_modulus: float, radius: float) -> BulletParams:
    """Return the block of this modulus (Pa) and its probe of `radius` (m)."""
    organ = {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": young_modulus, "nodes": 250}
    return rig.params(organ, {"radius": radius}, timestep=STEP_S)


def modulus(phase: float) -> float:
    """Return Young's modulus (Pa) at which the block has h w = `phase`."""
    organ = params(10e3, RADII_M[0]).organs["block"]
    free = np.where(organ.rest.nodes[:, 2] > organ.rest.nodes[:, 2].min(), 1.0, 0.0)
    return 10e3 * (phase / (STEP_S * highest_frequency(organ.rest, free, organ.elastic))) ** 2


def errors(phase: float, radius: float, place: str) -> list[float]:
    """Return by what part Bullet's force at rest differs from the reference, at `DEPTHS_M`."""
    model = params(modulus(phase), radius)
    at, body = places(model)[place], Body(model.organs["block"])
    found: list[float] = []
    with rig.Rig(model, start=(*at, radius + 1e-3)) as probe:
        for depth in DEPTHS_M:
            probe.move((*at, radius - depth), 0.06)
            probe.hold(0.2)
            true = body.press([[*at, radius - depth]], [radius])[0, 2]
            found.append(float(probe.force[2] / true - 1.0))
    return found


def main() -> None:
    """Print the table."""
    for phase in PHASES:
        cells = [
            f"{place} {radius * 1e3:.0f} mm" + "".join(f"{e:+8.1%}" for e in errors(phase, radius, place))
            for place in ("node", "face")
            for radius in RADII_M
        ]
        print(f"h w {phase:.1f}  {'  '.join(cells)}  rule {-face_loss(phase):+.1%}", flush=True)


if __name__ == "__main__":
    main()
