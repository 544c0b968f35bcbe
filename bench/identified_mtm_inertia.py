"""Fit bodies to the identified dynamics of a master tool manipulator.

It writes robots/dvrk/data/mtm_inertia.json and prints how well they agree. The method is that of
`bench/identified_inertia.py`. Terms of the wrist roll alone are left out: the identified ones are below the
identification's own errors, and no inertia.

    python bench/identified_mtm_inertia.py
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from identified_inertia import pseudo_inertias
from scipy.optimize import least_squares

from robots.dvrk import identified_mtm, mtm
from robots.dvrk.dynamics import STANDARD_GRAVITY, Dynamics
from robots.dvrk.inertia import Inertia
from robots.dvrk.linkage import MTM

OUTPUT = Path(__file__).parents[1] / "robots" / "dvrk" / "data" / "mtm_inertia.json"
CHAIN = mtm.chain("MTML")
NAMES = [joint.name for joint in CHAIN.joints]

# Mass, centre, size of a box in `MTML_base` with every joint at 0, estimated from the links' lengths.
GUESS = {
    "outer_yaw": (2.0, (0.0, 0.0, 0.05), (0.12, 0.12, 0.2)),
    "shoulder_pitch": (1.2, (0.0, 0.0, -0.12), (0.08, 0.08, 0.28)),
    "crank": (0.6, (0.0, 0.02, 0.0), (0.08, 0.2, 0.08)),
    "bar": (0.25, (0.0, -0.10, -0.14), (0.03, 0.03, 0.28)),
    "elbow_pitch": (0.9, (0.0, -0.10, -0.28), (0.06, 0.36, 0.06)),
    "wrist_platform": (0.25, (0.05, -0.3645, -0.24), (0.12, 0.06, 0.16)),
    "wrist_pitch": (0.12, (0.05, -0.3645, -0.15), (0.10, 0.10, 0.06)),
    "wrist_yaw": (0.08, (0.0, -0.34, -0.13), (0.08, 0.06, 0.05)),
    "wrist_roll": (0.05, (0.0, -0.38, -0.129), (0.03, 0.06, 0.03)),
}
SCALES = np.array([3e-3, 3e-3, 3e-3, 3e-4, 1e-4, 1e-4, 1e-4])
"""Square roots of kg m^2 that weigh as much as a change of the guess by exp(2)."""
GRAVITY_SCALE, GUESS_WEIGHT, POSITIONS, SEED = 2e-3, 0.3, 50, 7


def terms():
    """Return the terms of inertia and gravity by the pseudo-inertias, and their identified values."""
    boxes = {name: Inertia.of_box(m, np.array(c), np.array(s)) for name, (m, c, s) in GUESS.items()}
    arm = Dynamics(CHAIN, MTM, boxes, np.zeros(7))
    places = np.random.default_rng(SEED).uniform(CHAIN.lower, CHAIN.upper, (POSITIONS, 7))
    inertia_maps, gravity_maps = [], []
    for q in places:
        slopes = arm.displacements(q)
        gravity_maps.append(STANDARD_GRAVITY * slopes[:, :, 2])
        inertia_maps.append(slopes)
    return (
        np.linalg.cholesky([box.pseudo_inertia for box in boxes.values()]),
        np.array(inertia_maps),
        np.array([identified_mtm.inertia_matrix(q) for q in places]),
        np.array(gravity_maps),
        np.array([identified_mtm.gravity(q) for q in places]),
    )


def fit():
    roots, slopes, inertias, gravity_maps, gravities = terms()
    inertia_maps = np.einsum("qbiac,qbjad->qijbcd", slopes, slopes)
    scale = np.sqrt(np.outer(SCALES, SCALES))

    def errors(x):
        bodies = pseudo_inertias(x.reshape(len(roots), 10), roots)
        return (
            np.einsum("qijbcd,bcd->qij", inertia_maps, bodies) - inertias,
            np.einsum("qbic,bc->qi", gravity_maps, bodies[..., 3]) - gravities,
        )

    def residual(x):
        inertia, gravity = errors(x)
        return np.concatenate(
            [
                (inertia / scale)[:, :6, :6].ravel() / np.sqrt(inertia.size),
                gravity.ravel() / GRAVITY_SCALE / np.sqrt(gravity.size),
                GUESS_WEIGHT * 0.1 * x,
            ]
        )

    found = least_squares(residual, np.zeros(10 * len(roots)), max_nfev=120)
    return pseudo_inertias(found.x.reshape(len(roots), 10), roots), errors(found.x), inertias, gravities


def main():
    bodies, (inertia, gravity), inertias, gravities = fit()
    rows = {}
    for name, pseudo in zip(GUESS, bodies, strict=True):
        mass, centre = pseudo[3, 3], pseudo[:3, 3] / pseudo[3, 3]
        second = pseudo[:3, :3] - mass * np.outer(centre, centre)
        tensor = np.trace(second) * np.eye(3) - second
        rows[name] = {
            "mass": round(mass, 6),
            "centre": centre.round(6).tolist(),
            "tensor": tensor.round(9).tolist(),
        }
        print(f"{name:15} {mass:8.4f} kg  centre {centre.round(4)}  moments {np.linalg.eigvalsh(tensor)}")
    for i, name in enumerate(NAMES):
        print(
            f"{name:15} inertia {np.abs(inertia[:, i, i]).max():.2g}"
            f" of {np.abs(inertias[:, i, i]).max():.3g} kg m^2,"
            f" gravity {np.abs(gravity[:, i]).max():.2g} of {np.abs(gravities[:, i]).max():.3g} N m"
        )
    OUTPUT.write_text(
        json.dumps({"made_by": "bench/identified_mtm_inertia.py", "bodies": rows}, indent=1) + "\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
