"""Where organs join, both look alike; elsewhere as without joints."""

from __future__ import annotations

import numpy as np

from engines.mujoco.textures.joints import joined_recipes
from engines.mujoco.textures.noise import SEED, Noise
from engines.mujoco.textures.tissues import TISSUES

NAMES = {"cystic_duct": "duct", "gallbladder": "gallbladder", "liver": "liver", "colon": "colon"}


def line(start: float, end: float) -> np.ndarray:
    """Points along x, m."""
    x = np.linspace(start, end, 200)
    return np.stack([x, 0.0 * x, 0.0 * x], axis=1).astype(np.float32)


def test_a_duct_grows_out_of_its_gallbladder_without_a_seam() -> None:
    rest = {"cystic_duct": line(0.0, 0.02), "gallbladder": line(-0.04, 0.0)}
    alone = {name: TISSUES[NAMES[name]] for name in rest}
    joined, noise = joined_recipes(alone, NAMES, rest), Noise(SEED)
    seam, far = line(-2e-4, 2e-4), {"cystic_duct": line(0.012, 0.02), "gallbladder": line(-0.04, -0.012)}
    one, other = (joined[name](noise, seam).colour for name in rest)
    assert np.abs(one - other).max() < 1e-6
    for name, points in far.items():
        found, bare = joined[name](noise, points), alone[name](noise, points)
        assert all(np.array_equal(a, b) for a, b in zip(found, bare, strict=True))


def test_organs_without_tubes_have_no_joints() -> None:
    rest = {"liver": line(0.0, 0.02), "colon": line(-0.04, 0.0)}
    alone = {name: TISSUES[NAMES[name]] for name in rest}
    assert joined_recipes(alone, NAMES, rest) == alone
