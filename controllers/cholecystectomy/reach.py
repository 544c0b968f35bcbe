"""Joint margins on the way of a hand from its present pose. SI units, poses in the world."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from robots import rotation
from robots.dvrk.inverse import branches
from robots.transform import inverse_transform, pose_to_matrix
from schemas.vectors import Vector

__all__ = ["path_margins"]

_SHARES = (0.25, 0.5, 0.75)
"""Checked parts of the line from the present pose to the first pose of a path."""


def path_margins(hand: SurgeonHand, paths: Vector) -> tuple[Vector, Vector]:
    """Return the least joint margin of each path, (n,), and the joints at its poses, (n, poses, 6).

    1 is the middle of a joint's range and 0 its end. The arm stays on the branch of its inverse kinematics in
    which it is now.

    Args:
        hand: the arm, with its measured joints.
        paths: poses of the tip, shape (n, poses, 4, 4).
    """
    start, chain = pose_to_matrix(hand.line()), hand.chain
    lines = np.array([[_between(start, path[0], share) for share in _SHARES] for path in paths])
    into_base = inverse_transform(hand.base)
    now = branches(chain, into_base @ start)
    branch = int((np.abs(now - hand.joints) / (chain.upper - chain.lower)).max(axis=-1).argmin())
    q = branches(chain, into_base @ np.concatenate([lines, paths], axis=1))[branch]
    free = 2.0 * np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    least: Vector = free.min(axis=(-2, -1))
    return least, q[:, len(_SHARES) :]


def _between(start: Vector, end: Vector, share: float) -> Vector:
    """Return the pose, shape (4, 4), at a share of a straight line with an even turn."""
    turn = rotation.log(rotation.from_matrix(end[:3, :3] @ start[:3, :3].T))
    pose = np.eye(4)
    pose[:3, :3] = rotation.matrix(rotation.exp(share * turn)) @ start[:3, :3]
    pose[:3, 3] = start[:3, 3] + share * (end[:3, 3] - start[:3, 3])
    return pose
