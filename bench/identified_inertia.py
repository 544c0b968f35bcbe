"""Fit bodies to the identified dynamics of the PSM.

It writes robots/dvrk/data/psm_inertia.json and prints how well they agree.

The pseudo-inertia of each body is that of a guess L L^T, changed to (L M) (L M)^T with M lower triangular,
its diagonal exp(x): whatever x is, a body can have this inertia (Rucker and Wensing, "Smooth parameterization
of rigid-body inertia", RA-L 2022). Least squares over x: gravity exactly, the inertia matrix with a residual
that grows with the third power so that no position of the arm is left behind, and x itself, so that what no
measurement tells stays near the guess.

    python bench/identified_inertia.py
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from robots.dvrk import identified, linkage, psm
from robots.dvrk.arm_bodies import instrument
from robots.dvrk.dynamics import STANDARD_GRAVITY, Dynamics
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import instrument as tool_of

OUTPUT = Path(__file__).parents[1] / "robots" / "dvrk" / "data" / "psm_inertia.json"
TOOL = tool_of("LARGE_NEEDLE_DRIVER_400006")
MOVING = instrument(TOOL)
HOUSING = identified.INSERTION_MASS - sum(body.mass for body in MOVING.values())

# Mass, centre, size of a box: CAD (WPI-AIM/dvrk_env psm.urdf.xacro, of the column psm.sdf: 0.355 kg; sizes
# from its meshes); insertion and
# counterweight by their identified masses, carriage and housing of the instrument 0.08 m below the carriage's
# frame, counterweight in the column.
GUESS = {
    "yaw": (1.4705, (0.0, -0.528, -0.0388), (0.1625, 0.296, 0.145)),
    "pitch": (0.355, (0.0, -0.0449, 0.2798), (0.0775, 0.0795, 0.575)),
    "insertion": (HOUSING, (0.0, -0.004, 0.35), (0.08, 0.044, 0.4)),
    "pitch_back": (0.98494, (0.0, -0.5474, -0.0216), (0.103, 0.15, 0.303)),
    "pitch_front": (0.074425, (-0.0476, -0.4476, 0.0922), (0.034, 0.018, 0.168)),
    "pitch_bottom": (0.44569, (0.0, -0.302, 0.154), (0.095, 0.53, 0.058)),
    "pitch_top": (0.17841, (0.0, -0.243, 0.1806), (0.095, 0.53, 0.018)),
    "counterweight": (identified.COUNTERWEIGHT_MASS, (0.0, -0.043, 0.30), (0.04, 0.04, 0.1)),
}
INERTIA_SCALE, GRAVITY_SCALE, GUESS_WEIGHT = 4e-3, 2e-4, 0.5
"""kg m^2 and N m that weigh as much as a change of the guess by exp(2)."""

_TRIANGLE = np.tril_indices(4)
_DIAGONAL = _TRIANGLE[0] == _TRIANGLE[1]
_UPPER = np.triu_indices(3)


def pseudo_inertias(x, roots):
    factors = np.zeros((len(roots), 4, 4))
    factors[:, _TRIANGLE[0], _TRIANGLE[1]] = np.where(_DIAGONAL, np.exp(x), x)
    factors = roots @ factors
    return factors @ factors.swapaxes(1, 2)


def terms():
    """Return the terms of inertia and gravity by the pseudo-inertias, and their values.

    The values are without the share of the instrument.
    """
    chain = psm.chain(TOOL)
    boxes = {
        name: Inertia.of_box(mass, np.array(centre), np.array(size))
        for name, (mass, centre, size) in GUESS.items()
    }
    arm = Dynamics(chain, linkage.PSM, boxes, np.zeros(6))
    tool = Dynamics(chain, linkage.PSM, MOVING, np.zeros(6))
    inertia_maps, inertias, gravity_maps, gravities = [], [], [], []
    for q1, q2, q3 in itertools.product((-1.2, 0.0, 1.0), np.linspace(-0.925, 0.925, 7), (0.0, 0.12, 0.24)):
        q = np.array([q1, q2, q3, 0.0, 0.0, 0.0])
        slopes = arm.displacements(q)[:, :3]  # (bodies, 3, 4, 4)
        gravity_maps.append(STANDARD_GRAVITY * slopes[:, :, 2])
        gravities.append(identified.gravity(q) - tool.gravity(q)[:3])
        if q1 == 0.0:
            inertia_maps.append(np.einsum("biac,bjad->ijbcd", slopes, slopes)[_UPPER])
            inertias.append((identified.inertia_matrix(q) - tool.inertia_matrix(q)[:3, :3])[_UPPER])
    roots = np.linalg.cholesky([box.pseudo_inertia for box in boxes.values()])
    return roots, np.array(inertia_maps), np.array(inertias), np.array(gravity_maps), np.array(gravities)


def fit():
    roots, inertia_maps, inertias, gravity_maps, gravities = terms()

    def errors(x):
        bodies = pseudo_inertias(x.reshape(len(roots), 10), roots)
        return (
            np.einsum("qkbcd,bcd->qk", inertia_maps, bodies) - inertias,
            np.einsum("qbic,bc->qi", gravity_maps, bodies[..., 3]) - gravities,
        )

    def residual(x):
        inertia, gravity = errors(x)
        inertia, gravity = inertia.ravel() / np.sqrt(inertia.size), gravity.ravel() / np.sqrt(gravity.size)
        large = inertia * np.sqrt(inertia.size) / (2.5 * INERTIA_SCALE)
        return np.concatenate(
            [
                inertia / INERTIA_SCALE,
                10.0 * large**3 / np.sqrt(large.size),
                gravity / GRAVITY_SCALE,
                GUESS_WEIGHT * x,
            ]
        )

    found = least_squares(residual, np.zeros(10 * len(roots)), max_nfev=400)
    return pseudo_inertias(found.x.reshape(len(roots), 10), roots), errors(found.x)


def main():
    bodies, (inertia, gravity) = fit()
    rows = {}
    for name, pseudo in zip(GUESS, bodies, strict=True):
        mass, centre = pseudo[3, 3], pseudo[:3, 3] / pseudo[3, 3]
        second = pseudo[:3, :3] - mass * np.outer(centre, centre)
        tensor = np.trace(second) * np.eye(3) - second
        rows[name] = {
            "mass": round(mass, 6),
            "centre": centre.round(6).tolist(),
            "tensor": tensor.round(8).tolist(),
        }
        print(
            f"{name:14} {mass:8.4f} kg  centre {centre.round(4)}  moments"
            f" {np.linalg.eigvalsh(tensor).round(6)}"
        )
    print(
        f"largest error: inertia matrix {np.abs(inertia).max():.2g} kg m^2 (of 0.4167), gravity"
        f" {np.abs(gravity).max():.2g} N m"
    )
    OUTPUT.write_text(
        json.dumps({"made_by": "bench/identified_inertia.py", "bodies": rows}, indent=1) + "\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
