"""How comfortably an arm reaches a pose: how far its joints are from the ends of their ranges."""

from __future__ import annotations

import numpy as np

from robots.dvrk.cart import inverse_pose
from robots.dvrk.inverse import branches
from robots.serial_chain import SerialChain
from schemas.vectors import Vector

__all__ = ["margins"]


def margins(chain: SerialChain, base: Vector, tips: Vector) -> Vector:
    """Return for each of n ways the least margin of any joint at any pose of it, shape (n,).

    1 is the middle of a joint's range and 0 its end; a way keeps to one branch of the inverse kinematics.

    Args:
        chain: a PSM with a wrist of three joints.
        base: of its base in the world, shape (4, 4), m.
        tips: in the world, shape (n, poses, 4, 4), m.
    """
    q = branches(chain, inverse_pose(base) @ tips)  # (4, n, poses, 6)
    free = 2.0 * np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    least: Vector = free.min(axis=(-2, -1)).max(axis=0)
    return least
