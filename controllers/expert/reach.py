"""Joint margins of an arm at a pose, and points of its instrument. SI units, poses in the world."""

from __future__ import annotations

import numpy as np

from robots.dvrk.instruments import SHAFT_RADIUS, WRIST_RADIUS
from robots.dvrk.inverse import branches
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform
from schemas.vectors import Vector

__all__ = ["LINK_RADII", "links", "margins", "ways"]

_WRIST, _SHAFT = np.linspace(0.0, 1.0, 5), np.linspace(0.0, 0.08, 17)
"""Points along the link from the wrist's yaw axis to its pitch axis, and from there up the shaft, m."""
LINK_RADII = np.concatenate([np.full(len(_WRIST), WRIST_RADIUS), np.full(len(_SHAFT), SHAFT_RADIUS)])
"""Radii of the instrument about the points of `links`, m."""


def ways(chain: SerialChain, base: Vector, tips: Vector) -> tuple[Vector, Vector]:
    """Return the least joint margin, (n,), and the joints, (n, poses, 6), of each of n paths.

    1 is the middle of a joint's range and 0 its end. A path keeps to the branch of the inverse kinematics
    with the largest margin.

    Args:
        chain: a PSM with a wrist of three joints.
        base: transform from the arm's base to the world, shape (4, 4), m.
        tips: in the world, shape (n, poses, 4, 4), m.
    """
    q = branches(chain, inverse_transform(base) @ tips)  # (4, n, poses, 6)
    free = 2.0 * np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    least: Vector = free.min(axis=(-2, -1))
    best = least.argmax(axis=0)
    each = np.arange(len(best))
    return least[best, each], q[best, each]


def margins(chain: SerialChain, base: Vector, tips: Vector) -> Vector:
    """Return the least margins of `ways` alone."""
    return ways(chain, base, tips)[0]


def links(chain: SerialChain, base: Vector, q: Vector) -> Vector:
    """Return points in the wrist and the shaft of an instrument, shape (n, points, 3), for joints (n, 6)."""
    frames = chain.frames(q)
    yaw, pitch = frames[:, 5, None, :3, 3], frames[:, 4, None, :3, 3]
    up = -pitch / np.linalg.norm(pitch, axis=-1, keepdims=True)  # the shaft goes through the base's origin
    points = np.concatenate([yaw + _WRIST[:, None] * (pitch - yaw), pitch + _SHAFT[:, None] * up], axis=1)
    return points @ base[:3, :3].T + base[:3, 3]
