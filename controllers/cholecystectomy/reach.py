"""Joint margins on the way of a hand from its present pose. SI units, poses in the world."""

from __future__ import annotations

import numpy as np

from controllers.cholecystectomy.surgeon_hand import SurgeonHand, line_poses
from robots.transform import pose_to_matrix
from schemas.vectors import Vector

__all__ = ["path_margins"]

_SHARES = np.array([0.25, 0.5, 0.75])
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
    lines = np.array([line_poses(start, path[0], _SHARES) for path in paths])
    q = hand.joints_along(np.concatenate([lines, paths], axis=1))
    free = 2.0 * np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)
    least: Vector = free.min(axis=(-2, -1))
    return least, q[:, len(_SHARES) :]
