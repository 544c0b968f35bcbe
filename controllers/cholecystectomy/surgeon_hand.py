"""A robot hand that knows its joints: no joint turns too fast on its lines. SI units, poses in the world."""

from __future__ import annotations

import numpy as np

from controllers.expert.hand import RobotHand
from controllers.least_jerk import PEAK_SPEED
from robots import rotation
from robots.dvrk.instruments import Jaw
from robots.dvrk.inverse import branches
from robots.serial_chain import SerialChain
from robots.transform import inverse_transform, pose_to_matrix
from schemas.vectors import Vector

__all__ = ["SurgeonHand", "line_poses"]

_INSERTION, _ROLL = 2, 3
"""Numbers of two joints of a PSM."""
_SHARES = np.linspace(0.0, 1.0, 13)
_TURN = 2.0
"""Largest speed of a revolute joint, rad/s; the servo lags behind faster ones."""


class SurgeonHand(RobotHand):
    """An arm's line and jaw, with the measured joints."""

    def __init__(self, arm: str, base: Vector, chain: SerialChain, jaw: Jaw) -> None:
        super().__init__(arm, base, chain, jaw)
        self.joints: Vector = np.zeros(len(chain.joints))
        """Measured joint positions, rad and m, shape (6,)."""

    def joints_along(self, paths: Vector) -> Vector:
        """Return the joints along paths of the tip from the present pose, shape (..., n, 6).

        They stay on the present branch, and the roll goes on beyond half a turn, in range or not.

        paths: shape (..., n, 4, 4).
        """
        chain, into_base = self.chain, inverse_transform(self.base)
        off = branches(chain, into_base @ pose_to_matrix(self.line())) - self.joints
        off[:, _ROLL] = np.remainder(off[:, _ROLL] + np.pi, 2.0 * np.pi) - np.pi
        branch = int((np.abs(off) / (chain.upper - chain.lower)).max(axis=-1).argmin())
        q = branches(chain, into_base @ paths)[branch]
        present = np.full((*q.shape[:-2], 1), self.joints[_ROLL])
        q[..., _ROLL] = np.unwrap(np.concatenate([present, q[..., _ROLL]], axis=-1))[..., 1:]
        return q

    def go(self, goal: Vector, share: float = 1.0) -> None:
        """Begin a line to `goal`, shape (7,), at a fraction of the speed, slower where joints turn far."""
        poses = line_poses(pose_to_matrix(self.line()), pose_to_matrix(goal), _SHARES)
        q = self.joints_along(poses)
        turns = np.abs(np.diff(np.delete(q, _INSERTION, axis=1), axis=0)).max(initial=0.0)
        super().go(goal, share)
        speed = PEAK_SPEED * float(turns) * (len(_SHARES) - 1)
        self.state.duration = max(self.state.duration, speed / _TURN)


def line_poses(start: Vector, end: Vector, shares: Vector) -> Vector:
    """Return the poses at shares of a straight line with an even turn, shape (n, 4, 4)."""
    turn = rotation.log(rotation.from_matrix(end[:3, :3] @ start[:3, :3].T))
    poses: Vector = np.tile(np.eye(4), (len(shares), 1, 1))
    for pose, share in zip(poses, shares.tolist(), strict=True):
        pose[:3, :3] = rotation.matrix(rotation.exp(share * turn)) @ start[:3, :3]
        pose[:3, 3] = start[:3, 3] + share * (end[:3, 3] - start[:3, 3])
    return poses
